"""Commands that show how right the program is, on its own benchmarks and on the paper."""
