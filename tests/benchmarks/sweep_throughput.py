"""Members of a sweep a second on one and on two processes; on an idle machine the second is to give at least 1.8 times.

    .venv/bin/python tests/benchmarks/sweep_throughput.py
"""

from rig_nodes.sweep.throughput import sweep_throughput

ROUNDS = 3  # one and two in turn; the best of each counts


def main() -> None:
    best: dict[int, dict] = {}
    for _ in range(ROUNDS):
        for workers in (1, 2):
            result = sweep_throughput(workers)
            if workers not in best or result["seconds"] < best[workers]["seconds"]:
                best[workers] = result
    for result in best.values():
        print("{workers} process(es): {members_per_second:.2f} members/s; {members} members in {seconds:.2f} s; "
              "the parent computed {parent_cpu_seconds:.3f} s".format(**result))
    print(f"gain: {best[2]['members_per_second'] / best[1]['members_per_second']:.2f}")


if __name__ == "__main__":
    main()
