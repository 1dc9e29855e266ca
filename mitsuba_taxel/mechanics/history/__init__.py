"""States that depend on earlier states: viscoelastic silicones in time steps, and indenters with friction.

Input: a path, a viscoelastic material, and the rows of a load with their times. Output: the state at the end of the
last row, with its internal variables and the errors due to time steps.
"""
