"""What the user describes: scenes as XML or Python, their parameters, pads and pairs of LED and phototransistor.

XML files, dictionaries and parameter values enter; a `Scene` leaves, as text or loaded by Mitsuba. A mistake in a
description is refused here, before anything is deformed or traced.
"""
