"""A smoother that lags, three ways: a program, a class called by the sample, a function.

hmpim run --rig "process:python examples/software/smoother.py" s.csv -o r.h5
hmpim run --rig python:examples/software/smoother.py:Smoother s.csv -o r.h5
hmpim run --rig python:examples/software/smoother.py:smooth s.csv -o r.h5
"""

import sys


class Smoother:
    """y[k] = 0.8 y[k-1] + 0.2 u[k-2]: made anew for each run."""

    def __init__(self):
        self.y = 0.0
        self.waiting = [0.0, 0.0]

    def __call__(self, u):
        self.waiting.append(u)
        self.y = 0.8 * self.y + 0.2 * self.waiting.pop(0)
        return self.y


def smooth(samples):
    """The same, for the whole array."""
    smoother = Smoother()
    return [smoother(u) for u in samples]


def main():
    """Speak hmpim's line protocol over standard input and output."""
    greeting = sys.stdin.readline()
    if not greeting.startswith("hmpim 1 "):
        print("error this program speaks hmpim 1")
        return
    print("ready", flush=True)
    smoother = Smoother()
    for line in sys.stdin:
        if line.strip() == "end":
            break
        print(repr(smoother(float(line))), flush=True)


if __name__ == "__main__":
    main()
