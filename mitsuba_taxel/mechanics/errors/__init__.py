"""The error of a state, from the same load on other elements, or with half the reach of contact.

Input: a path and a state on it. Output: errors at the roofs and of the force, deviations of the displacement, and the
size of elements that keeps an error below a target.
"""
