"""pytest puts the folder of a conftest on `sys.path`: with this file the unit tests can import `result_factory`."""
