"""Make data sets on disk from drives of the expert: episodes, samples, labels, rows of arrays, shards."""
