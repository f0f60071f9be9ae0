"""What the drivers share: figures of a part of the process."""

import json
import resource
import time


def clock() -> tuple[float, float]:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime, time.monotonic()


def tell(start: tuple[float, float]) -> None:
    cpu, wall = clock()
    print(json.dumps({"cpu_seconds": cpu - start[0], "wall_seconds": wall - start[1]}))
