"""This package runs a model: it compiles the functions, locates events and finds the motion after events.

Each folder is a floor and imports only from the floors before it. Read them in this order: `native`, `series`,
`lowering`, `system`, `record`, `roots`, `linear`, `events`, `run`.
"""
