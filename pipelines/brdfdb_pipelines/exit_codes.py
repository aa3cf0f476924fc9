"""Exit codes of the command line."""

from __future__ import annotations

VIOLATED = 1  # the audit found a new violation, or a table without a record of its source
REFUSED = 2  # bad input, a damaged store, or a machine that lacks something: one sentence on stderr
BUG = 70  # an error of this program (EX_SOFTWARE of sysexits.h); its traceback is in a file
INTERRUPTED = 130  # Ctrl-C: 128 + SIGINT
TERMINATED = 143  # told to end, as batch systems and containers do: 128 + SIGTERM
