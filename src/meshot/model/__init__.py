"""What is learned: networks, their losses and their weights."""
