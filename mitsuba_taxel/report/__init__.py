"""Web pages of studies, pictures of sensors, and display in notebooks.

Input: the folder of a study, fit, optimisation or tolerance analysis, or a scene. Output: a single web page, a picture,
or the HTML of an object.
"""
