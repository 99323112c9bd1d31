"""From drives of the expert to a data set on disk: episodes, samples, labels, rows of arrays, shards."""
