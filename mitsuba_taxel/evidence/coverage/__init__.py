"""Stated errors compared with true errors, for readings, slopes, figures of merit, dragged indenters and light.

Settings enter, drawn at random from all kinds; rows with stated and true error leave (`taxel bench coverage`,
`figures`, `drags`, `light`, `domes`, `slopes`, `horizon`).
"""
