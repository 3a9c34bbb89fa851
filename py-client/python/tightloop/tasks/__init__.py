"""Tasks that come with tightloop; their names are those of `tightloop.env.registry.TASKS`."""
