"""Judges the pilot's frames by the definition of an unsafe frame in docs/can.md.

Written from the .dbc and that page alone. All times are integers in microseconds, so that a limit is a limit.
"""
import math
from collections import Counter, deque
from dataclasses import dataclass

import dbc
from network import EXTENDED, PRIORITY, Network
from protection import counter_step, frame_crc

MS = 1000  # [us]
FEEDBACK_LIMIT = 60 * MS  # age of each of the truck's three frames while steering
MEASUREMENT_LIMIT = 300 * MS  # age of the measurement that steers
FUTURE_LIMIT = 50 * MS  # a measurement may lie ahead
STOP_LIMIT = 20 * MS  # from a stop request to the stop bit
TAKE_OVER_LIMIT = 40 * MS  # from an operator's feedback to the end of steering: 20 ms and a tick
WINDOW, WINDOW_FRAMES = 250 * MS, 16  # frames of one identifier
UNTOLD_LIMIT = 60 * MS  # steering without telling source or state
RECORD = 100 * MS  # of feedback that a command may stem from
RATE = 15.0  # [deg/s]
MAX_ANGLE = 45.0  # [deg]
MAX_SPEED = 9.7222  # [m/s]
DEGRADED_SPEED = 1.5  # [m/s]
LATERAL_ACCELERATION = 2.0  # [m/s^2]
FRONT, REAR = 1.95, 3.17  # [m] axles to hinge, of the truck's data sheet
ROUNDING = 0.0101  # [deg] of two angles on the wire
SPEED_ROUNDING = 0.00051  # [m/s]
INIT, STANDBY, ARMED, ACTIVE, DEGRADED, STOPPING, STOPPED = range(7)
SOURCE_NONE, SOURCE_HOLD = 0, 8
DRIVING, STANDING = (ACTIVE, DEGRADED), (INIT, STANDBY, ARMED, STOPPED)
STAMP_MODULUS = 65536  # [ms]
NEVER = -10**18


def key_of(identifier):
    """What a frame is known by: under J1939 its priority says nothing."""
    return identifier & ~PRIORITY if identifier & EXTENDED else identifier


def _text(identifier, length, data, remote):
    number = f'{identifier & ~EXTENDED:08X}#' if identifier & EXTENDED else f'{identifier:03X}#'
    return number + ('R' if remote else data.to_bytes(8, 'little')[:length].hex().upper())


@dataclass
class Finding:
    time: int  # [us]
    clause: str  # a..f of the definition
    kind: str
    detail: str
    frame: str

    def as_dict(self):
        return {'time': self.time / 1e6, 'clause': self.clause, 'kind': self.kind, 'detail': self.detail,
                'frame': self.frame}


@dataclass
class Command:
    """One TP_COMMAND and what its set has told so far."""
    time: int
    counter: int
    steering: bool
    stop: bool
    angle: float  # [deg]
    speed: float  # [m/s]
    frame: str
    source_told: bool = False
    state_told: bool = False


class Stream:
    """One identifier: its layout, its counter, the times of its last frames."""

    def __init__(self, layout):
        self.identifier, self.length, self.data_id = key_of(layout.identifier), layout.length, layout.data_id
        self.name = layout.name
        self.checked = [(name, s) for name, s in layout.signals.items()
                        if name != 'Crc' and (s.low > (-s.sign) or s.high < (s.mask >> (1 if s.sign else 0)))]
        self.times = deque(maxlen=WINDOW_FRAMES)
        self.fresh = NEVER  # when the last right frame came
        self.restart()

    def restart(self):
        self.counter = None

    def wrong(self, length, data):
        """Why the frame is to be discarded, but for its counter; None when it is right."""
        if length != self.length:
            return 'length', f'{length} bytes'
        if data & 0xFF != frame_crc(data, self.data_id):
            return 'crc', f'{data & 0xFF:02X} is not {frame_crc(data, self.data_id):02X}'
        for name, signal in self.checked:
            if not signal.low <= signal.raw(data) <= signal.high:
                return 'range', f'{name} is {signal.raw(data) * signal.factor:g}'
        return None

    def step(self, data):
        """True when the counter goes on rightly. The stream is followed either way."""
        before, self.counter = self.counter, data >> 8 & 0xF
        return before is None or counter_step(before, self.counter) in (1, 2)


class Judge:
    """Feed it frames and events in the order of their time; what happened off the bus comes before a frame of the
    same time. `events`: False when no log of events is to be had; what hangs on it is then not judged.
    `jitter` [us]: how late a time stamp may be, on a live bus. `name`: the pilot's NAME on a J1939 network, None: that of
    the first who claims its address."""

    def __init__(self, dbc_file, events=True, jitter=0, name=None):
        layouts = dbc.read(dbc_file)
        self.events_known, self.jitter = events, jitter
        self.streams = {key_of(frame.identifier): Stream(frame) for frame in layouts.values()}
        self.names = {frame.name: key_of(frame.identifier) for frame in layouts.values()}
        self.signals = {name: frame.signals for name, frame in layouts.items()}
        self.states = layouts['TP_STATUS'].values['State']
        self.sources = {word: n for n, word in layouts['TP_COMMAND_INFO'].values['Source'].items()}
        self.pilot = {key_of(frame.identifier) for frame in layouts.values() if frame.sender == 'PILOT'}
        self.network = None  # of the profile plain
        if all(identifier & EXTENDED for identifier in self.pilot):
            self.network = Network(self.pilot, name, not events,
                                   lambda time, kind, detail, text: self._find(time, 'f', kind, detail, text))
        self.required = [self.streams[self.names[name]]
                         for name in ('TRUCK_FEEDBACK', 'TRUCK_MOTION', 'TRUCK_STATUS')]
        self.handlers = {self.names['TP_COMMAND']: self._command, self.names['TP_COMMAND_INFO']: self._info,
                         self.names['TP_STATUS']: self._status, self.names['TRUCK_FEEDBACK']: self._feedback,
                         self.names['TRUCK_MOTION']: self._motion, self.names['TRUCK_STATUS']: lambda *_: None}
        self.findings, self.reasons, self.counts = [], Counter(), Counter()
        self.unsafe_frames = 0
        self.foreign = Counter()  # announced by the log of events and not yet seen
        self.longest_silence = 0  # [us] between two TP_COMMANDs
        self.clock_offset = 0  # [us] of the clock that stamps the scans, ahead of the bus's
        self._new_pilot(NEVER)
        self.angles, self.speeds, self.axle_speeds = deque(), deque(), deque()
        self.taken_over = None  # since when the operator drives

    def _new_pilot(self, time):
        for identifier in self.pilot:
            self.streams[identifier].restart()
        self.last = None  # TP_COMMAND
        self.pending = []  # steering commands whose state was not told
        self.cut = None  # the command whose set the bus broke within
        self.state = None
        self.state_time = self.source_time = time
        self.sequence = -1
        self.edge = None if self.events_known else NEVER  # when the operator last engaged, while it counts
        self.may_steer_to_stop = not self.events_known
        self.stop_asked = None
        self.measured = {}  # source: time of its last good measurement
        self.too_fast_since = None
        self.bus_broke = False  # since the last TP_COMMAND
        self.angle_history = deque()

    # ---- what happened off the bus

    def event(self, time, word, arguments=()):
        """Throws ValueError for a word or arguments that docs/can.md does not know."""
        if not self.events_known:
            raise ValueError('an event, though there was to be no log of events')
        handler = {'start': self._new_pilot_event, 'engage': self._engage, 'release': self._stop_if_driving,
                   'stop': self._stop, 'command_stop': self._stop_if_driving, 'reset': self._reset,
                   'measurement': self._measurement, 'foreign': self._foreign, 'bus': self._bus,
                   'clock': self._clock}.get(word)
        if handler is None:
            raise ValueError(f'unknown event "{word}"')
        self.counts['events'] += 1
        try:
            handler(time, *arguments)
        except TypeError:
            raise ValueError(f'wrong number of arguments for event "{word}"') from None

    def _new_pilot_event(self, time):
        self._new_pilot(time)
        if self.network:
            self.network.start()

    def _engage(self, time):
        self.edge = time

    def _stop(self, time):
        if self.stop_asked is None:
            self.stop_asked = time

    def _stop_if_driving(self, time):
        if self.state in DRIVING:
            self._stop(time)

    def _reset(self, _time):
        self.stop_asked = None

    def _measurement(self, time, source, age='0'):
        if source not in self.sources:
            raise ValueError(f'unknown source "{source}"')
        self.measured[self.sources[source]] = time - round(float(age) * MS)

    def _foreign(self, _time, frame):
        self.foreign[frame.upper()] += 1

    def _bus(self, time, state):
        if state not in ('up', 'down'):
            raise ValueError('a bus is up or down')
        for identifier in self.pilot:
            self.streams[identifier].restart()
        self.source_time = self.state_time = time
        self.bus_broke = True
        if state == 'down':
            self.cut = self.last
        if self.network:
            self.network.bus(time, state == 'up')

    def _clock(self, _time, offset):
        self.clock_offset = round(float(offset) * MS)

    # ---- frames

    def frame(self, time, identifier, length, data, remote=False, sender=None):
        """`data`: the bytes as a little-endian number. `sender` True: known to be the pilot, False: known to be
        somebody else, None: not known. Identifiers of 29 bits have bit 31 set."""
        key = key_of(identifier)
        stream = self.streams.get(key)
        self.counts['frames'] += 1
        before = len(self.findings)
        if self.network and identifier & EXTENDED and stream is None:
            self._other_network_frame(time, identifier, length, data, remote)
        if stream is None:
            self.counts['other frames'] += 1
        elif key in self.pilot:
            self._pilot_frame(time, stream, length, data, remote, sender, _text(identifier, length, data, remote))
        else:
            self._truck_frame(time, stream, length, data, remote)
        self.unsafe_frames += len(self.findings) > before

    def is_pilots(self, identifier):
        return key_of(identifier) in self.pilot

    def _other_network_frame(self, time, identifier, length, data, remote):
        text = _text(identifier, length, data, remote)
        managed = not remote and self.network.hear(time, identifier, length, data, text)
        if not managed and self.network.is_foreign(identifier):
            self._find(time, 'e', 'foreign', 'sent by somebody else', text)

    def _truck_frame(self, time, stream, length, data, remote):
        handler = self.handlers.get(stream.identifier)
        if handler is None:
            return
        if remote or stream.wrong(length, data) or not stream.step(data):
            self.counts['wrong truck frames'] += 1
            return
        stream.fresh = time
        handler(time, data, '')

    def _pilot_frame(self, time, stream, length, data, remote, sender, text):
        self.counts['pilot frames'] += 1
        if sender is False or self.foreign[text]:
            if sender is not False:
                self.foreign[text] -= 1
            return self._find(time, 'e', 'foreign', 'sent by somebody else', text)
        if self.network:
            self.network.pilot_frame(time, self.jitter, text)
        if len(stream.times) == WINDOW_FRAMES and time - stream.times[0] + self.jitter <= WINDOW:
            self._find(time, 'b', 'period', f'{WINDOW_FRAMES + 1} in {(time - stream.times[0]) / MS:g} ms', text)
        stream.times.append(time)
        wrong = ('length', 'a remote frame') if remote else stream.wrong(length, data)
        if wrong:
            # A range is a limit when a limit of its own stands behind it.
            return self._find(time, 'a', *wrong, text)
        before = stream.counter
        if not stream.step(data):
            self._find(time, 'a', 'counter', f'{before} to {stream.counter}', text)
        self.handlers[stream.identifier](time, data, text)

    def _find(self, time, clause, kind, detail, frame):
        self.findings.append(Finding(time, clause, kind, detail, frame))
        self.reasons[f'{clause} {kind}'] += 1

    # ---- the truck's record

    @staticmethod
    def _remember(record, time, value, length=RECORD):
        record.append((time, value))
        while record[0][0] < time - length:
            record.popleft()

    def _feedback(self, time, data, _text):
        signals = self.signals['TRUCK_FEEDBACK']
        self._remember(self.angles, time, signals['ArticulationAngle'].raw(data) * 0.01)
        self._remember(self.speeds, time, abs(signals['Speed'].raw(data)) * 0.001)
        operator_drives = not data >> 13 & 1 or data >> 14 & 1
        if not operator_drives:
            self.taken_over = None
        elif self.taken_over is None:
            self.taken_over = time

    def _motion(self, time, data, _text):
        self._remember(self.axle_speeds, time, abs(self.signals['TRUCK_MOTION']['FrontAxleSpeed'].raw(data)) * 0.01)

    def _lowest_speed(self):
        """The higher of two sources, each the lowest of what the command may have been made of [m/s]."""
        return max((min(value for _, value in record) for record in (self.speeds, self.axle_speeds) if record),
                   default=0.0)

    # ---- TP_COMMAND

    def _command(self, time, data, text):
        signals = self.signals['TP_COMMAND']
        command = Command(time, data >> 8 & 0xF, bool(data >> 12 & 1), bool(data >> 13 & 1),
                          signals['ArticulationAngle'].raw(data) * 0.01, signals['Speed'].raw(data) * 0.001, text)
        last, self.last = self.last, command
        if last:
            self.longest_silence = max(self.longest_silence, time - last.time)
            if last.steering and not last.state_told:
                self.pending.append(last)
        self._check_stop(time, command)
        if abs(command.speed) > MAX_SPEED + SPEED_ROUNDING or command.speed < 0.0:
            self._find(time, 'b', 'speed', f'{command.speed:.3f} m/s', text)
        if not command.steering:
            self.too_fast_since = None
            self.angle_history.clear()
            if command.speed:
                self._find(time, 'c', 'speed without steering', f'{command.speed:.3f} m/s', text)
            return
        if command.stop and command.speed:
            self._find(time, 'c', 'speed in a stop', f'{command.speed:.3f} m/s', text)
        self._check_ages(time, text)
        self._check_angle(command, last)
        self._check_lateral_acceleration(command, last)
        self._remember(self.angle_history, time, abs(command.angle))

    def _check_stop(self, time, command):
        if command.stop or self.stop_asked is None:
            return
        late = time - self.stop_asked
        if late > STOP_LIMIT + self.jitter:
            self._find(time, 'c', 'no stop bit', f'{late / MS:g} ms after the request', command.frame)

    def _check_ages(self, time, text):
        for stream in self.required:
            age = time - stream.fresh
            if age > FEEDBACK_LIMIT + self.jitter:
                told = 'never came' if stream.fresh == NEVER else f'is {age / MS:g} ms old'
                self._find(time, 'c', 'steers on old feedback', f'{stream.name} {told}', text)
        if self.taken_over is not None and time - self.taken_over > TAKE_OVER_LIMIT + self.jitter:
            self._find(time, 'c', 'steers against the operator', f'{(time - self.taken_over) / MS:g} ms', text)
        could_speak = self.network.may_speak or NEVER if self.network else NEVER
        for word, told in (('source', self.source_time), ('state', self.state_time)):
            since = max(told, could_speak)
            if time - since > UNTOLD_LIMIT + self.jitter:
                self._find(time, 'c', f'{word} not told', f'for {(time - since) / MS:g} ms', text)

    def _check_angle(self, command, last):
        if abs(command.angle) > MAX_ANGLE:
            self._find(command.time, 'b', 'angle', f'{command.angle:.2f} deg', command.frame)
        gone, self.bus_broke = self.bus_broke and last and command.time - last.time > UNTOLD_LIMIT, False
        if last and last.steering and not gone:
            turned = abs(command.angle - last.angle)
            elapsed = min(command.time - last.time, UNTOLD_LIMIT)
        elif self.angles:  # begins at the measured angle
            measured = [value for _, value in self.angles]
            turned = max(min(measured) - command.angle, command.angle - max(measured), 0.0)
            elapsed = 20 * MS
        else:
            return  # without any feedback it is unsafe already
        allowed = RATE * (elapsed + self.jitter) * 1e-6 + ROUNDING
        if turned > allowed:
            self._find(command.time, 'b', 'rate', f'{turned:.2f} deg in {elapsed / MS:g} ms', command.frame)

    def _check_lateral_acceleration(self, command, last):
        speed = self._lowest_speed()
        angle = max(abs(command.angle) - ROUNDING, 0.0) * math.pi / 180.0
        curvature = math.sin(angle) / (FRONT * math.cos(angle) + REAR)
        sideways = curvature * speed * speed
        if sideways <= LATERAL_ACCELERATION:
            self.too_fast_since = None
            return
        if self.too_fast_since is None:
            self.too_fast_since = command.time
        measured = max((abs(value) for _, value in self.angles), default=0.0)
        before = abs(last.angle) if last and last.steering else 0.0
        winds_up = abs(command.angle) > max(measured, before) + ROUNDING
        long_ago = self.angle_history[0][1] if self.angle_history else before
        stays = (not command.stop and command.time - self.too_fast_since > RECORD
                 and abs(command.angle) >= long_ago - ROUNDING)
        if winds_up or stays:
            self._find(command.time, 'b', 'lateral acceleration',
                       f'{sideways:.2f} m/s^2 at {speed:.2f} m/s and {command.angle:.2f} deg', command.frame)

    # ---- TP_COMMAND_INFO

    def _info(self, time, data, text):
        self.source_time = time
        sequence = data >> 32
        if sequence < self.sequence:
            self._find(time, 'd', 'sequence', f'{self.sequence} to {sequence}', text)
        self.sequence = max(sequence, self.sequence)
        command = self.last
        if command is None or command.counter != data >> 8 & 0xF or command.source_told:
            return
        command.source_told = True
        if command.steering:
            self._check_source(command, data >> 12 & 0xF, data >> 16 & 0xFFFF, text)

    def _check_source(self, command, source, stamp, text):
        if source in (SOURCE_NONE, SOURCE_HOLD) and not command.stop:
            self._find(command.time, 'c', 'nobody steers', 'steering without a source and without a stop', text)
        if source == SOURCE_HOLD:
            return  # holds what was measured: the age of the feedback is what counts
        now = command.time + self.clock_offset
        age = now - stamp * MS
        age = (age + FUTURE_LIMIT + self.jitter) % (STAMP_MODULUS * MS) - FUTURE_LIMIT - self.jitter
        if age > MEASUREMENT_LIMIT + MS + self.jitter:  # the stamp is cut to whole milliseconds
            self._find(command.time, 'c', 'old measurement', f'stamp is {age / MS:g} ms old', text)
        elif self.events_known and source in self.measured:
            since = command.time - self.measured[source]
            if since > MEASUREMENT_LIMIT + self.jitter:
                self._find(command.time, 'c', 'old measurement', f'last good one {since / MS:g} ms ago', text)

    # ---- TP_STATUS

    def _status(self, time, data, text):
        state, before = data >> 12 & 0xF, self.state
        self.state, self.state_time = state, time
        # Before this state, which may end the operator's edge.
        could_steer = before is not None and self._may_steer(before)
        could_begin = before == ARMED and self.edge is not None
        self._follow_edges(time, state, before)
        for command in self.pending:  # its own state was lost: one of its neighbours' must allow it
            allowed = self._may_steer(state) or could_steer or could_begin and command is self.cut
            if not allowed:
                self._find(command.time, 'c', 'steers', f'in {self.states[state]}', command.frame)
        self.pending = []
        command = self.last
        if command is None or command.counter != data >> 8 & 0xF or command.state_told:
            return
        command.state_told = True
        self._check_state(command, state, text)

    def _follow_edges(self, time, state, before):
        if state in (INIT, STANDBY, STOPPED):
            if self.edge is not None and time > self.edge:
                self.edge = None
            self.may_steer_to_stop = False
        elif state == ARMED and not self.events_known:
            self.edge = time
        elif state == STOPPING and before != STOPPING:
            if before is not None:
                self.may_steer_to_stop = self.edge is not None and before in (ARMED, ACTIVE, DEGRADED)
            self.edge = None

    def _may_steer(self, state):
        return self.edge is not None if state in DRIVING else state == STOPPING and self.may_steer_to_stop

    def _check_state(self, command, state, text):
        name = self.states[state]
        if command.steering and not self._may_steer(state):
            kind = 'steers' if state in STANDING else 'no re-arm edge'
            self._find(command.time, 'c', kind, f'in {name}', text)
        if state in (STOPPING, STOPPED) and not command.stop:
            self._find(command.time, 'c', 'no stop bit', f'in {name}', text)
        if state == DEGRADED and command.speed > DEGRADED_SPEED + SPEED_ROUNDING:
            self._find(command.time, 'b', 'speed', f'{command.speed:.3f} m/s in DEGRADED', text)

    # ---- what came out

    def report(self):
        foreign = self.reasons['e foreign']
        return {
            'frames': self.counts['frames'], 'pilot_frames': self.counts['pilot frames'],
            'wrong_truck_frames': self.counts['wrong truck frames'], 'events': self.counts['events'],
            'events_judged': self.events_known, 'unsafe_frames': self.unsafe_frames, 'foreign_frames': foreign,
            'longest_silence_ms': self.longest_silence / MS, 'reasons': dict(sorted(self.reasons.items())),
            'unsafe': [finding.as_dict() for finding in self.findings]}
