"""Studies computed: jobs, processes, pilot runs, results."""
