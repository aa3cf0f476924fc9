"""Progress of a build: bars on stderr for people, a JSON object a line on stdout for programs."""

from __future__ import annotations

import json
import time
from typing import Any

from rich.progress import Task, TaskID

from brdfdb.errors import counted
from brdfdb_pipelines import terminal

_LOG_S = 2.0  # interval [s] at which finished estimates are counted in a log

Event = dict[str, Any]


class Tally:
    """The number of finished values, the rate, and the remaining time."""

    def __init__(self, total: int) -> None:
        self.total = total
        self.done = 0
        self._computed = 0
        self._start = time.perf_counter()

    def add(self, values: int, *, kept: bool) -> Event:
        """Add values and return the fields of an event; `kept` values of an earlier build do not count for the rate."""
        self.done += values
        self._computed += 0 if kept else values
        rate = self._computed / max(time.perf_counter() - self._start, 1e-9)
        left = (self.total - self.done) / rate if rate else None
        return {
            "values_done": self.done,
            "values_total": self.total,
            "values_per_s": round(rate),
            "seconds_left": None if left is None else round(left, 1),
        }


def print_json(event: Event) -> None:
    """Print an event as one line of JSON."""
    print(json.dumps(event), flush=True)


class Bars:
    """Progress bars: one for the build, and one for each table in progress that has several blocks."""

    def __init__(self) -> None:
        self._progress = terminal.progress(counted=False, text="{task.fields[rate]}")
        self._kernels: TaskID | None = None
        self._overall: TaskID | None = None
        self._measured: TaskID | None = None
        self._measuring: set[str] = set()
        self._tables: dict[str, TaskID] = {}
        self._logged = time.monotonic()

    def __enter__(self) -> Bars:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def __call__(self, event: Event) -> None:
        """Show an event."""
        match event["event"]:
            case "compiling" if event["kernels"] == 0:
                self._progress.console.print("compiling kernels, once after an installation")
            case "compiling":
                self._log("compiling kernels, once after an installation")
                self._kernels = self._begun("compiling, once after an installation", event["kernels"], "kernels")
            case "compiled" if self._kernels is not None:
                self._advance(self._kernels)
            case "start":
                if self._kernels is not None:
                    self._progress.remove_task(self._kernels)
                self._log(f"planning {counted(event['tables'], 'table')}")
                self._overall = self._begun("planning", event["tables"], "tables")
            case "shards":
                self._log(f"tabulating {counted(event['tables'], 'table')}")
                self._overall = self._begun("tabulating", event["tables"], "tables")
            case "shard" if self._overall is not None:
                self._advance(self._overall, event["tables"])
            case "surveyed" if self._overall is not None:
                self._advance(self._overall)
            case "planned" if self._overall is not None:
                if not event["tables"]:
                    self._progress.remove_task(self._overall)
                    self._overall = None
                else:
                    self._log(f"tabulating {counted(event['tables'], 'table')}")
                    self._progress.reset(self._overall, description="tabulating", total=event["values"], rate="")
            case "waiting":
                self._progress.console.print(f"waiting for {event['material']}: another build is building it")
            case "idle":
                self._progress.console.print("the cluster has no workers; waiting for a worker (Ctrl-C stops)")
            case "failed":
                self._progress.console.print(
                    f"{event['material']} failed: {event['error']}", markup=False, soft_wrap=True
                )
                self._ended(event["material"], made=False)
            case "block":
                name = event["material"]
                if event["blocks"] > 1:
                    if name not in self._tables:
                        self._tables[name] = self._progress.add_task(f"  {name}", total=event["blocks"], rate="")
                    self._progress.advance(self._tables[name])
                if self._overall is not None:
                    rate = f"{event['values_per_s'] / 1e6:.1f} M values/s"
                    self._progress.update(self._overall, completed=event["values_done"], rate=rate)
            case "family":
                name = event["family"]
                if event["state"] == "measuring":
                    self._tables[name] = self._progress.add_task(f"  measuring {name}", total=None, rate="")
                elif (task := self._tables.pop(name, None)) is not None:
                    self._progress.remove_task(task)
                    error = terminal.error(event["error_p99"])
                    text = f"family {name}: {event['members']} tables, error at parameters between them {error} (p99)"
                    self._progress.console.print(text, markup=False)
            case "measuring":
                name = event["material"]
                if self._measured is None:
                    self._measured = self._begun("tabulating measured data", event["tables"], "tables")
                self._measuring.add(name)
                self._tables[name] = self._progress.add_task(f"  {name}, measured", total=None, rate="")
            case "simulating" | "estimate" | "judged" | "interpolating":
                self._show_simulation(event)
            case "published" | "adopted" | "unchanged":
                self._ended(event["material"])

    def _show_simulation(self, event: Event) -> None:
        """Show an event of a simulated table."""
        name = event["material"]
        if event["event"] == "simulating":
            self._log(f"simulating {name} by rays")
            self._tables[name] = self._progress.add_task(f"  {name}, simulated", total=None, rate="")
        if (task := self._tables.get(name)) is None:
            return  # an estimate failed, and others end after it
        match event["event"]:
            case "estimate":
                self._progress.update(task, total=event["of"])
                self._progress.advance(task)
                if time.monotonic() - self._logged > _LOG_S:
                    self._log(f"{name}: {self._bar(task).completed:.0f} of {event['of']} realisations")
            case "judged":
                error = f"standard error {100.0 * event['standard_error']:.2g} %"
                self._progress.update(task, total=event["next"], rate=error)
                self._log(
                    f"{name}: {event['realisations']} realisations, {error}, target {100.0 * event['target']:.2g} %"
                )
            case "interpolating":
                self._log(f"{name}: interpolating and tabulating")
                text = f"  {name}, interpolating and tabulating"
                self._progress.reset(task, description=text, total=None, rate="")

    def _ended(self, name: str, *, made: bool = True) -> None:
        """Remove the bar of a table, and advance that of all measured ones if it is measured and was made."""
        if (task := self._tables.pop(name, None)) is not None:
            self._progress.remove_task(task)
        if name in self._measuring and self._measured is not None:
            self._measuring.remove(name)
            if made:
                self._advance(self._measured)

    def _log(self, text: str) -> None:
        """Print what begins now, unless a terminal shows the bar."""
        if not self._progress.console.is_terminal:
            self._progress.console.print(text)
            self._logged = time.monotonic()

    def _begun(self, description: str, total: int, unit: str) -> TaskID:
        return self._progress.add_task(description, total=total, unit=unit, rate=f"0/{total} {unit}")

    def _bar(self, task: TaskID) -> Task:
        return self._progress.tasks[self._progress.task_ids.index(task)]

    def _advance(self, task: TaskID, units: int = 1) -> None:
        """Advance a bar by some of its units, and say how many of them are done."""
        self._progress.advance(task, units)
        bar = self._bar(task)
        self._progress.update(task, rate=f"{bar.completed:.0f}/{bar.total:.0f} {bar.fields['unit']}")
