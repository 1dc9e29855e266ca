"""States that depend on earlier ones: viscoelastic silicones in steps of time, bodies with friction.

Input: a path, a viscoelastic material, and the rows of a load with their times. Output: the state at the end of the
last row, with its internal variables and the errors by time steps.
"""
