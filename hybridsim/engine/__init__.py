"""The engine runs a declared automaton: it compiles its functions, finds its events and decides what follows them.

Each folder is a floor and imports only from the floors before it. Read them in this order: `native`, `series`,
`lowering`, `system`, `record`, `roots`, `linear`, `events`, `run`.
"""
