#!/usr/bin/env python3
"""check_bag.py FOLDER CUT TOPIC: a bag whose recording a power cut ended at CUT [s since the epoch, the recorder's clock]:
sound, and with samples of TOPIC until shortly before. Exit code 1 when it is not."""
import glob
import sqlite3
import sys

# The recorder commits once a second; the commit's own time and the writing of the clock come on top.
LIMIT_S = 1.5

folder, cut, topic = sys.argv[1], float(sys.argv[2]), sys.argv[3]
(path,) = glob.glob(folder + "/*.db3")
bag = sqlite3.connect(path)
(sound,) = bag.execute("PRAGMA integrity_check").fetchone()
(count,) = bag.execute("SELECT count(*) FROM messages").fetchone()
stamps = [row[0] * 1e-9 for row in bag.execute(
    "SELECT timestamp FROM messages JOIN topics ON topics.id = topic_id WHERE name = ? ORDER BY messages.id", (topic,))]
if not stamps:
    sys.exit(f"  bag: {count} samples, none of {topic}")
gap = max((b - a for a, b in zip(stamps, stamps[1:])), default=0.0)
print(f"  bag: {count} samples, {len(stamps)} of {topic} in {stamps[-1] - stamps[0]:.1f} s, largest gap {gap:.2f} s, "
      f"last {cut - stamps[-1]:.2f} s before the cut; integrity: {sound}")
sys.exit(0 if sound == "ok" and cut - stamps[-1] <= LIMIT_S else 1)
