"""The engine runs a model: it compiles its functions, locates events and finds the motion after each event.

Each folder is a floor and imports only from the floors before it. Read them in this order: `native`, `series`,
`lowering`, `system`, `record`, `roots`, `linear`, `events`, `run`.
"""
