"""The page in the browser, its server, and what drives its frames."""
