"""The arithmetic of the gate: closed forms, no resampling, the same numbers in every process."""
