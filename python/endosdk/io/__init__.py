"""Files in and out, bounded and whole: documents, pictures, point clouds; and the progress bar."""
