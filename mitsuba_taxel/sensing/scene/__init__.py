"""Descriptions of scenes in XML or Python, their parameters, and their pads and pairs of LED and phototransistor.

Input: XML files, dictionaries and parameter values. Output: a `Scene`, as text or loaded by Mitsuba. Mistakes in a
description are refused here, before a pad is deformed or light is traced.
"""
