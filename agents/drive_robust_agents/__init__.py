"""Reference agents for pytest-drive-robust: one agent, one module. They get no private access."""
