"""The command line `drive-robust`, for everything that needs no test; one module per command."""
