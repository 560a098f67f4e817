"""Work over many frames: batch, benchmark, processes and their progress."""
