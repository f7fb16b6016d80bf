"""Writers of the devices' bytes, independent of the parsers: written from the frame tables.

What they write is what a device would send; how it is damaged on the way is for `wire_damage`.
"""

import json
import struct


def int24(value):
    """Return a signed number in three bytes, least significant first."""
    return int(value).to_bytes(3, 'little', signed=True)


def node_frame3(nodes, role=2, number=7, system_time=1000, local_time=900, voltage=4.9):
    """Return a NodeFrame3; nodes are (role, number, mm, first path dB, received dB)."""
    body = b''.join(
        bytes([kind, which]) + int24(mm) + bytes([round(-2 * first), round(-2 * received)])
        for kind, which, mm, first, received in nodes
    )
    length = 21 + len(body) + 1
    frame = bytes([0x55, 0x05]) + length.to_bytes(2, 'little') + bytes([role, number])
    frame += local_time.to_bytes(4, 'little') + system_time.to_bytes(4, 'little') + bytes(4)
    frame += round(voltage * 1000).to_bytes(2, 'little') + bytes([len(nodes)]) + body
    return frame + bytes([sum(frame) % 256])


def node_frame2(
    nodes, role=2, number=7, system_time=1000, local_time=900, place_mm=(0, 0, 0), filler=0
):
    """Return a NodeFrame2, inertial data filled up with one byte."""
    frame = bytes([0x55, 0x04])
    frame += (119 + 13 * len(nodes) + 1).to_bytes(2, 'little') + bytes([role, number])
    frame += system_time.to_bytes(4, 'little') + bytes([10, 10, 20])
    frame += b''.join(int24(axis) for axis in place_mm) + b''.join([int24(0)] * 3)
    frame += bytes([filler]) * (9 + 12 + 12 + 12 + 6 + 16 + 4)
    frame += local_time.to_bytes(4, 'little') + bytes(10) + (4900).to_bytes(2, 'little')
    frame += bytes([len(nodes)])
    for kind, which, mm, first, received in nodes:
        frame += bytes([kind, which]) + int24(mm)
        frame += bytes([round(-2 * first), round(-2 * received)])
        frame += system_time.to_bytes(4, 'little') + bytes(2)
    return frame + bytes([sum(frame) % 256])


def lec_line(anchors, place=None, quality=60):
    """Return a line of `lec`; anchors are (address, place [m], range [m])."""
    line = f'DIST,{len(anchors)}'
    for index, (address, (x, y, z), range_m) in enumerate(anchors):
        line += f',AN{index},{address:04X},{x:.2f},{y:.2f},{z:.2f},{range_m:.2f}'
    if place is not None:
        line += ',POS,{:.2f},{:.2f},{:.2f},'.format(*place) + str(quality)
    return line.encode() + b'\r\n'


def les_line(anchors, place=None, quality=60):
    """Return a line of `les`; the rest as for `lec_line`."""
    words = [
        f'{address:04X}[{x:.2f},{y:.2f},{z:.2f}]={range_m:.2f}'
        for address, (x, y, z), range_m in anchors
    ]
    if place is not None:
        words.append('le_us=3082')
        words.append('est[{:.2f},{:.2f},{:.2f},'.format(*place) + f'{quality}]')
    return ' '.join(words).encode() + b'\r\n'


def tlv(kind, value):
    """Return one type, length, value."""
    return bytes([kind, len(value)]) + value


def place_bytes(place, quality):
    """Return a position of the TLV interface, place in millimetres."""
    return struct.pack('<iiiB', *place, quality)


def location_answer(anchors, place=(1000, 2000, 300), quality=70):
    """Return a tag's answer to dwm_loc_get; anchors are (address, mm, quality, place [mm])."""
    value = bytes([len(anchors)])
    for address, mm, good, where in anchors:
        value += struct.pack('<HIB', address, mm, good) + place_bytes(where, 100)
    return tlv(0x40, b'\x00') + tlv(0x41, place_bytes(place, quality)) + tlv(0x49, value)


def anchor_location_answer(tags, place=(0, 0, 0)):
    """Return an anchor's answer to dwm_loc_get; tags are (id, mm, quality)."""
    value = bytes([len(tags)]) + b''.join(struct.pack('<QIB', *tag) for tag in tags)
    return tlv(0x40, b'\x00') + tlv(0x41, place_bytes(place, 100)) + tlv(0x48, value)


def datagram(ranges, **more):
    """Return a datagram; ranges are dictionaries."""
    return json.dumps({'v': 1, 'ranges': ranges, **more}).encode()
