"""Devices are found by what they are, not by the order of their ports."""

from types import SimpleNamespace

import pytest

from lemtomap.drivers.errors import PortMissing
from lemtomap.errors import BadSetting
from lemtomap.robot.devices.ports import HOKUYO, KOBUKI, find


def port(device, vid, pid, product=None, serial=None, manufacturer=None):
    return SimpleNamespace(
        device=device, vid=vid, pid=pid, product=product, serial_number=serial, manufacturer=manufacturer
    )


FTDI = port("/dev/ttyUSB0", 0x0403, 0x6001, "FT232R USB UART", "A5XK3RJT", "FTDI")
BASE = port("/dev/ttyUSB1", 0x0403, 0x6001, "iClebo Kobuki", "kobuki_A505QO28", "Yujin Robot")
LASER = port("/dev/ttyACM0", 0x15D1, 0x0000, "URG-Series USB Driver", None, "Hokuyo Automatic Co, Ltd.")
BOARD = port("/dev/ttyS0", None, None)


def test_each_device_is_found_whatever_the_order():
    for order in ([FTDI, BASE, LASER, BOARD], [LASER, BOARD, BASE, FTDI]):
        assert find(KOBUKI, lambda order=order: order) == "/dev/ttyUSB1"
        assert find(HOKUYO, lambda order=order: order) == "/dev/ttyACM0"


def test_a_bare_ftdi_cable_is_no_kobuki_and_the_error_names_it():
    with pytest.raises(
        PortMissing, match=r"no Kobuki base found.*/dev/ttyUSB0 \(FT232R USB UART, 0403:6001\)"
    ):
        find(KOBUKI, lambda: [FTDI, BOARD])
    with pytest.raises(PortMissing, match="none at all"):
        find(HOKUYO, lambda: [BOARD])


def test_two_of_a_kind_are_not_chosen_by_luck():
    other = port("/dev/ttyACM1", 0x15D1, 0x0000)
    with pytest.raises(BadSetting, match="/dev/ttyACM0, /dev/ttyACM1; give --hokuyo"):
        find(HOKUYO, lambda: [other, LASER])
