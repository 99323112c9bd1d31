"""Every option of the command line, the ini file and the marker, stated once."""
