"""What the training examples share."""
