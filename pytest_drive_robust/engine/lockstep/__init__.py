"""Many episodes at once in one worker process."""
