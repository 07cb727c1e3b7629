"""CRC-8 of docs/can.md, as tables: a CRC is linear in its bits, so it is the XOR of what each part adds."""
POLYNOMIAL = 0x2F


def _after_byte(crc):
    for _ in range(8):
        crc = (crc << 1 ^ (POLYNOMIAL if crc & 0x80 else 0)) & 0xFF
    return crc


_BYTE = [_after_byte(crc) for crc in range(256)]


def crc(data):
    """Of any bytes, one after the other; what the tables are made from and checked by."""
    value = 0xFF
    for byte in data:
        value = _BYTE[value ^ byte]
    return value ^ 0xFF


def _shifted(value, count):
    for _ in range(count):
        value = _BYTE[value]
    return value


def _table(first, second):
    """What bytes number `first` (low) and `second` (high; None: none) of the frame add to its CRC."""
    low = [_shifted(byte, 9 - first) for byte in range(256)]  # bytes first..7, then the DataId
    if second is None:
        return low
    high = [_shifted(byte, 9 - second) for byte in range(256)]
    return [one ^ other for other in high for one in low]


_TABLE_12, _TABLE_34, _TABLE_56, _TABLE_7 = _table(1, 2), _table(3, 4), _table(5, 6), _table(7, None)
_CONSTANTS = [crc(bytes([0] * 7 + [data_id])) for data_id in range(256)]


def frame_crc(data, data_id):
    """CRC that the frame with these 64 bits (little-endian) must carry in its byte 0."""
    return (_TABLE_12[data >> 8 & 0xFFFF] ^ _TABLE_34[data >> 24 & 0xFFFF] ^ _TABLE_56[data >> 40 & 0xFFFF]
            ^ _TABLE_7[data >> 56] ^ _CONSTANTS[data_id])


def counter_step(before, now):
    """1 and 2 are right, all else is wrong."""
    return (now - before) % 15
