"""What is shown of work that goes on: bars on terminals and in notebooks, lines elsewhere."""

from __future__ import annotations

import functools
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib.util import find_spec
from typing import Any, NamedTuple, TypeVar

from .compiled import news
from .data_files import read_data_file
from .log import Level, console_level, count_things

T = TypeVar("T")
# Called with a stage, how much of it is done, and how much there is; None where nobody knows.
Update = Callable[..., None]

FIRST_S = 0.3  # seconds until the first line: a command that ends sooner needs none
LINE_S = 10.0  # seconds between two lines about one stage: enough to see that it goes on
RATE_S = 2.0  # seconds of a stage before a rate is shown: the first ones say little


class Stage(NamedTuple):
    """What happens in a stage, and what is counted there, empty where nothing is."""

    text: str
    unit: str = ""


STAGES = {name: Stage(**row) for name, row in read_data_file("progress").items()}


def ignore_progress(*_: object) -> None:
    """Show no news, where nobody wants them."""


def show_progress(stage: str) -> AbstractContextManager[Update]:
    """Show that `stage` has begun, and yield the function that further news goes to."""
    if console_level() is Level.error:
        return nullcontext(ignore_progress)
    return show(StageBars(stage) if sys.stderr.isatty() else StageLines(stage))


def show_in_notebook(stage: str) -> AbstractContextManager[Update]:
    """Yield the function that gets news; it draws bars in a notebook that can show them."""
    return show(StageBars(stage)) if is_notebook() else nullcontext(ignore_progress)


@contextmanager
def show(shown: StageBars | StageLines) -> Iterator[Update]:
    """Yield the function that gets news, those of compiling as well."""
    with shown:
        earlier, news.listener = news.listener, functools.partial(shown.update, "compile")
        try:
            yield shown.update
        finally:
            news.listener = earlier


def is_notebook() -> bool:
    """Tell whether this is a notebook with ipywidgets, which rich draws its bars with."""
    if "IPython" not in sys.modules or find_spec("ipywidgets") is None:
        return False
    from rich.console import Console

    return Console().is_jupyter


def count_progress(
    items: Iterable[T], stage: str, update: Update, total: int | None = None
) -> Iterator[T]:
    """Yield the items, and report to `update` how many of a stage are done.

    >>> list(count_progress("ab", "convert", print, 2))
    convert 1 2
    convert 2 2
    ['a', 'b']
    """
    for done, item in enumerate(items, start=1):
        yield item
        update(stage, done, total)


class StageLines:
    """A line when a stage begins and every LINE_S seconds, none in the first FIRST_S."""

    def __init__(self, stage: str):
        self.stage, self.finished, self.first, self.start = stage, 0, 0, time.monotonic()
        self.total: int | None = None

    def __enter__(self) -> None:
        self.is_shown, self.is_over = False, threading.Event()
        self.thread = threading.Thread(target=self.repeat, daemon=True)
        self.thread.start()

    def __exit__(self, *_: object) -> None:
        self.is_over.set()
        self.thread.join()

    def update(self, stage: str, finished: int = 0, total: int | None = None) -> None:
        self.finished, self.total = finished, total
        if stage != self.stage:
            self.stage, self.first, self.start = stage, finished, time.monotonic()
            if self.is_shown:
                self.show_stage()

    def show_stage(self) -> None:
        total, unit = self.total, STAGES[self.stage].unit
        if self.stage == "compile" and total:
            print(f"hiproof: {news.headline(self.finished, total)}", file=sys.stderr, flush=True)
        else:
            print_line(self.stage, count_things(total, unit) if total else "")

    def repeat(self) -> None:
        if self.is_over.wait(FIRST_S):
            return
        self.is_shown = True
        self.show_stage()
        while not self.is_over.wait(LINE_S):
            seconds = time.monotonic() - self.start
            if seconds > LINE_S / 2:
                unit = STAGES[self.stage].unit
                text = describe(self.finished, self.total, seconds, unit, self.first)
                print_line(self.stage, text)


def print_line(stage: str, text: str) -> None:
    about = f": {text}" if text else ""
    print(f"hiproof: {STAGES[stage].text}{about}", file=sys.stderr, flush=True)


class StageBars:
    """A bar a stage on a terminal, gone when the command is done."""

    def __init__(self, stage: str):
        from rich.console import Console
        from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn
        from rich.text import Text

        class Details(ProgressColumn):
            """How much is done, how fast, and how long the rest takes."""

            def render(self, task: Any) -> Text:
                seconds, total = task.elapsed or 0.0, task.total
                return Text(
                    describe(
                        int(task.completed),
                        None if total is None else int(total),
                        seconds,
                        task.fields["unit"],
                        task.fields["first"],
                    )
                )

        columns = (TextColumn("{task.description}"), BarColumn(bar_width=24), Details())
        # what goes to a terminal stands above the bars; a file that takes the output keeps it
        self.bars = Progress(
            *columns,
            console=Console(stderr=True),
            transient=True,
            redirect_stdout=sys.stdout.isatty(),
        )
        self.tasks: dict[str, Any] = {}
        self.stage = ""
        self.update(stage)

    def __enter__(self) -> None:
        self.bars.start()

    def __exit__(self, *_: object) -> None:
        self.bars.stop()

    def update(self, stage: str, finished: int = 0, total: int | None = None) -> None:
        if stage not in self.tasks:
            fields: dict[str, Any] = {"unit": STAGES[stage].unit, "first": finished}
            self.tasks[stage] = self.bars.add_task(STAGES[stage].text, total=total, **fields)
        if stage not in (self.stage, "compile"):
            self.end_stage()
            self.stage = stage
        self.bars.update(self.tasks[stage], completed=finished, total=total)

    def end_stage(self) -> None:
        """Fill the bar of the stage that another one follows."""
        if self.stage:
            task = self.tasks[self.stage]
            total = self.bars.tasks[self.bars.task_ids.index(task)].total
            if total is None:  # nobody knew how much there was, and so nothing was counted
                self.bars.update(task, completed=1, total=1, unit="")
            else:
                self.bars.update(task, completed=total)
            self.bars.stop_task(task)


def describe(finished: int, total: int | None, seconds: float, unit: str, first: int = 0) -> str:
    """Describe in words how far a stage is that began at `first` of `total` `seconds` ago.

    >>> describe(120, 1000, 10.0, "building")
    '120 of 1,000 buildings, 12 a second, 73 s left'
    >>> describe(0, None, 31.4, "")
    '31 s'
    """
    if total is None or not unit:
        counted = [count_things(finished, unit)] if finished and unit else []
        return ", ".join([*counted, *([f"{seconds:.0f} s"] if seconds >= 1 else [])])
    text = f"{finished:,} of {count_things(total, unit)}"
    if not first < finished < total or seconds < RATE_S:
        return text
    rate = (finished - first) / seconds
    remainder = format_seconds((total - finished) / rate)
    return f"{text}, {rate:,.{0 if rate >= 10 else 1}f} a second, {remainder} left"


def format_seconds(seconds: float) -> str:
    """Write a duration in the largest unit that leaves two digits.

    >>> format_seconds(73.4), format_seconds(400), format_seconds(10000)
    ('73 s', '7 min', '2.8 h')
    """
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
