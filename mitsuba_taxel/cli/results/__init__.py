"""Commands on the results of studies: figures of merit, comparisons, reports, models and tables for others."""
