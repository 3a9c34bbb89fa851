"""What a task's functions are given and return: observations, rewards, memory and buffers."""
