"""What spoils the pictures of real endoscopes: drawn per pair, applied to any rendered pair, and kept on record."""
