"""Commands that look for designs: their spread, unknowns of a measurement, the best one."""
