"""Photo-reflectors from measured curves of current over distance.

Input: a table of distances of a mirror or white card, and of currents, and the file of a part. Output: the sizes and
the depth of the dies and the index of the resin, with intervals, in a file that scenes use as ``part``.
"""
