"""`drive-robust`: what one wants to know without writing a test; one module per command."""
