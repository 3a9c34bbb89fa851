"""Checks of what users pass, and warnings of likely mistakes."""
