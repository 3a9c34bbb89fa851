"""Seeds, starts, states and disturbances of episodes."""
