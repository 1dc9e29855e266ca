"""What the user describes: scenes as XML or Python, their parameters, pads and pairs of LED and phototransistor.

Input: XML files, dictionaries and parameter values. Output: a `Scene`, as text or loaded by Mitsuba. A mistake in a
description is refused here, before anything is deformed or traced.
"""
