"""Material laws from tests of a silicone.

Input: tables of uniaxial, planar and equibiaxial tests, and of relaxation. Output: laws ranked by their cross-validated
error, with intervals, in a file that scenes use as ``material``.
"""
