"""What every room stands on: errors, arguments, files, stages of a run, units."""
