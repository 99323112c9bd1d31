"""The modules of `benchmarks/paper.py`: the published table, results, estimates, patterns, pictures and pages."""
