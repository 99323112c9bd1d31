"""Where finished episodes of a run live: in memory, or in a folder that several processes share."""
