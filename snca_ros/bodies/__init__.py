"""MAP-Elites over bodies of one controller: the best of each size and number of feet."""
