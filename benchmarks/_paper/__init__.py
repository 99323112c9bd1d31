"""What `benchmarks/paper.py` is made of: the published table, results, estimates, patterns, pictures and pages."""
