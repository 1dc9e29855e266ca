"""Stated errors compared with true errors, for readings, figures of merit, dragged indenters and light.

Input: settings, drawn at random from all kinds. Output: rows with stated and true error (`taxel bench coverage`,
`figures`, `drags`, `light`, `estimators`).
"""
