"""The error of a deformed state, from solutions of the same load on other elements, or with contact forces of half the
range.

Input: a load path and a state on it. Output: errors of the roofs and of the force, deviations of the displacement, and
the size of elements that keeps an error below a target.
"""
