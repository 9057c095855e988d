"""python3-can reads and drives the simulated sensors through the simulated slcan adapter: a client that knows the
adapter's protocol from elsewhere. Real time, some seconds."""

import pathlib
import subprocess
import sys
import tempfile
import time
import unittest

import can

ROSI, WORLD = sys.argv.pop(1), sys.argv.pop(1)
NODES = {1: 4, 2: 4, 3: 4, 10: 4}  # bytes of process data of each
LIMIT_S = 20.0


class SlcanTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        port = pathlib.Path(folder.name) / "can"
        drive = subprocess.Popen([ROSI, "sim", WORLD, "--live", "--out", folder.name], stdout=subprocess.DEVNULL,
                                 stderr=subprocess.DEVNULL)
        self.addCleanup(drive.wait, LIMIT_S)
        self.addCleanup(drive.terminate)
        self.end = time.monotonic() + LIMIT_S
        while not port.exists():
            self.assertLess(time.monotonic(), self.end, "no adapter appeared")
            time.sleep(0.01)
        self.bus = can.Bus(interface="slcan", channel=str(port), bitrate=250000, sleep_after_open=0.1)
        self.addCleanup(self.bus.shutdown)

    def send(self, identifier, data):
        self.bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))

    def receive_until(self, is_enough, say_again=None):
        """Messages until the condition holds; say_again is repeated every half second."""
        messages, due = [], 0.0
        while not is_enough(messages):
            self.assertLess(time.monotonic(), self.end, f"{len(messages)} messages, the last {messages[-4:]}")
            if say_again and time.monotonic() > due:
                say_again()
                due = time.monotonic() + 0.5
            message = self.bus.recv(timeout=0.05)
            if message:
                messages.append(message)
        return messages

    def start_all(self):
        def has_all(messages):
            return {0x180 + node for node in NODES} <= {m.arbitration_id for m in messages}
        return self.receive_until(has_all, lambda: self.send(0x000, [0x01, 0x00]))

    def test_started_nodes_send_their_process_data(self):
        for message in self.start_all():
            node = message.arbitration_id - 0x180
            if node in NODES:
                self.assertEqual(message.dlc, NODES[node])
                self.assertFalse(message.is_extended_id or message.is_remote_frame or message.is_error_frame)

    def test_stopped_nodes_are_silent_until_they_are_started_again(self):
        self.start_all()
        self.send(0x000, [0x02, 0x00])
        # What is still on its way is read until nothing has come for as long as thirty periods of the sensors.
        quiet_since = time.monotonic()
        while time.monotonic() - quiet_since < 0.3:
            self.assertLess(time.monotonic(), self.end, "the nodes do not stop")
            message = self.bus.recv(timeout=0.3)
            if message and 0x180 <= message.arbitration_id < 0x200:
                quiet_since = time.monotonic()
        self.start_all()

    def test_objects_are_read_and_written(self):
        def ask(request, answer_id):
            def is_answered(messages):
                return any(m.arbitration_id == answer_id for m in messages)
            found = self.receive_until(is_answered, lambda: self.send(answer_id + 0x80, request))
            return bytes(next(m.data for m in found if m.arbitration_id == answer_id))
        # Resolution of the inclinometer: ten thousandths of a degree.
        self.assertEqual(ask([0x40, 0x00, 0x60, 0, 0, 0, 0, 0], 0x58A), bytes.fromhex("4B 00 60 00 0A 00 00 00"))
        # An object that does not exist is refused with the code for that.
        self.assertEqual(ask([0x40, 0x34, 0x12, 0, 0, 0, 0, 0], 0x581), bytes.fromhex("80 34 12 00 00 00 02 06"))
        # Heartbeat every 100 ms.
        self.assertEqual(ask([0x2B, 0x17, 0x10, 0, 0x64, 0, 0, 0], 0x581), bytes.fromhex("60 17 10 00 00 00 00 00"))
        self.receive_until(lambda found: sum(m.arbitration_id == 0x701 for m in found) >= 3)


if __name__ == "__main__":
    unittest.main()
