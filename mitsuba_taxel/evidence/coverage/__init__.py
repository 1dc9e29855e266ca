"""Comparison of stated errors with true errors: of readings, figures of merit, dragged indenters and light.

Input: sensors drawn at random from all registered kinds of cells, loads and walls. Output: tables with the stated and
the true error of each (`taxel bench coverage`, `figures`, `drags`, `light`, `estimators`).
"""
