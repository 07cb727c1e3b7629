"""Makes traffic as a healthy pilot and truck would put it on the bus, and senders that misbehave in one way each.

A log is a list of items in the order of their time: ('event', time [us], words) and
('frame', time [us], name, fields), fields being physical values by the .dbc; what `encoded` makes of them may be
bent by a sender that is bad on the wire itself.
"""
import math
import random

import dbc
from judge import ACTIVE, ARMED, DEGRADED, INIT, MS, STANDBY, STOPPED, STOPPING
from protection import frame_crc

PERIOD = 20 * MS
PREVIEW, HOLD, DEAD_RECKONING = 2, 8, 7
OWN_NAME = 0x3000FF00FFE00001
REQUEST = '18EAFF55#00EE00'


class Drive:
    """One healthy drive: power-up, engage, drive, and what its script asks for."""

    def __init__(self, seed, j1939=False):
        self.random = random.Random(seed)
        self.items = []
        self.time = self.random.randrange(10**9, 10**12)
        self.counter = {'pilot': self.random.randrange(15), 'truck': self.random.randrange(15)}
        self.angle, self.speed, self.wanted = 0.0, 0.0, 0.0
        self.sequence = self.random.randrange(1000)
        self.target = 0.0
        self.override = self.key_off = self.faulty = False
        self.scan_age = 60 * MS
        self.silent_truck = self.silent_command = False
        self.repeat = False
        self.unsteady = MS  # [us] by which the truck's phase varies
        self.amplitude, self.rhythm = self.random.uniform(2.0, 12.0), self.random.uniform(4.0, 9.0)
        self.event('start')
        if j1939:
            self.claim()
            self.time += 250 * MS

    def event(self, *words):
        self.items.append(('event', self.time, list(words)))

    def frame(self, name, **fields):
        self.items.append(('frame', self.time, name, fields))

    def raw(self, text):
        """A frame that is in no .dbc, as `candump -L` writes it."""
        self.items.append(('raw', self.time, text))

    def claim(self, name=OWN_NAME, source=0x80):
        self.raw(f'18EEFF{source:02X}#{name.to_bytes(8, "little").hex().upper()}')

    def cycle(self, state, stop=False, source=PREVIEW, count_on=True):
        """20 ms of both sides: the truck first, the pilot 7 ms later."""
        late = self.random.randrange(self.unsteady)
        self.time += 6 * MS + late
        self._truck(state)
        self.time += 7 * MS
        self._pilot(state, stop, source, count_on)
        self.time += 7 * MS - late

    def _truck(self, state):
        driving = state in (ACTIVE, DEGRADED)
        goal = (1.4 if state == DEGRADED else self.wanted) if driving else 0.0
        self.speed += max(-0.044, min(0.016, goal - self.speed))
        if self.silent_truck:
            return
        counter = self._count('truck')
        self.frame('TRUCK_MOTION', AliveCounter=counter, FrontAxleSpeed=self.speed, RearAxleSpeed=self.speed)
        self.frame('TRUCK_STATUS', AliveCounter=counter, OperatorKey=1 if self.key_off else 2)
        self.frame('TRUCK_FEEDBACK', AliveCounter=counter, AutonomyEnabled=int(driving),
                   OperatorEnable=int(not self.key_off), OperatorOverride=int(self.override), Speed=self.speed,
                   ArticulationAngle=self.angle)

    def _pilot(self, state, stop, source, count_on):
        steering = state in (ACTIVE, DEGRADED, STOPPING)
        if state in (ACTIVE, DEGRADED):
            phase = 2.0 * math.pi * self.time * 1e-6 / self.rhythm
            self.target = self.amplitude * math.sin(phase)
            if not self.repeat:
                self.angle += max(-0.29, min(0.29, self.target - self.angle))
        if self.silent_command:
            self._count('pilot')
            return
        counter = self._count('pilot')
        if count_on and not self.repeat:
            self.sequence += 1
        speed = {ACTIVE: self.wanted, DEGRADED: min(self.wanted, 1.5)}.get(state, 0.0)
        if steering and source == PREVIEW and self.scan_age < 300 * MS:
            self.event('measurement', 'preview_driver', f'{self.scan_age / MS:g}')
        self.frame('TP_COMMAND', AliveCounter=counter, SteeringEnable=int(steering), Stop=int(stop), Mode=1,
                   ArticulationAngle=self.angle, Speed=speed, Acceleration=0.8 if speed else 2.0)
        self.frame('TP_COMMAND_INFO', AliveCounter=counter, Source=source, Sequence=self.sequence,
                   MeasurementStamp=(self.time - self.scan_age) // MS % 65536)
        self.frame('TP_STATUS', AliveCounter=counter, State=state)

    def _count(self, side):
        self.counter[side] = (self.counter[side] + 1) % 15
        return self.counter[side]

    def run(self, state, cycles, **how):
        for _ in range(cycles):
            self.cycle(state, **how)

    # ---- stretches of a drive

    def power_up(self):
        self.run(INIT, 20)
        self.run(STANDBY, self.random.randrange(5, 30))

    def engage(self):
        self.event('engage')
        self.run(ARMED, 6)
        self.wanted = self.random.uniform(1.6, 3.5)

    def drive(self, cycles=None):
        self.run(ACTIVE, cycles or self.random.randrange(100, 200))

    def stop(self, *event):
        self.event(*(event or ('stop',)))
        while self.speed > 0.0:
            self.cycle(STOPPING, stop=True, source=DEAD_RECKONING)
        self.run(STOPPED, 30, stop=True)

    def reset(self):
        self.event('reset')
        self.run(STANDBY, 10)

    def started(self):
        self.power_up()
        self.engage()
        self.drive()
        return self


# ---- good ones

def plain(drive):
    drive.drive()


def lost_single_frames(drive):
    for _ in range(5):
        drive.drive(drive.random.randrange(3, 20))
        first = len(drive.items)
        drive.cycle(ACTIVE)
        frames = [i for i in range(first, len(drive.items)) if drive.items[i][0] == 'frame']
        del drive.items[drive.random.choice(frames)]
    drive.drive()


def repeated_commands(drive):
    """A command may be sent again and again as long as its measurement is fresh."""
    for age in range(60, 300, 20):
        drive.scan_age, drive.repeat = age * MS, True
        drive.cycle(ACTIVE)
    drive.scan_age, drive.repeat = 60 * MS, False
    drive.drive()


def stop_and_go_again(drive):
    drive.stop()
    drive.reset()
    drive.engage()
    drive.drive()


def stop_at_its_limit(drive):
    """The last frame without the stop bit leaves exactly 20 ms after the request."""
    drive.cycle(ACTIVE)
    time = next(item[1] for item in reversed(drive.items) if item[0] == 'frame' and item[2] == 'TP_COMMAND')
    place = next(i for i, item in enumerate(drive.items) if item[1] > time - 20 * MS)
    drive.items.insert(place, ('event', time - 20 * MS, ['stop']))
    while drive.speed > 0.0:
        drive.cycle(STOPPING, stop=True, source=DEAD_RECKONING)
    drive.run(STOPPED, 5, stop=True)


def override(drive):
    """The operator takes over: steering ends within the next set, the truck brakes, the angle is the measured one."""
    drive.override = True
    drive.event('command_stop')
    drive.run(STOPPED, 10, stop=True)


def feedback_at_its_limit(drive):
    """Lost sets of the truck: steering goes on while the last is not older than exactly 60 ms."""
    heard = _last(drive, 'TRUCK_FEEDBACK')[1]
    drive.silent_truck = drive.repeat = True
    drive.run(ACTIVE, 2)
    drive.time = heard + 60 * MS
    drive._pilot(ACTIVE, False, PREVIEW, False)
    drive.time += 7 * MS
    drive.silent_truck = drive.repeat = False
    drive.drive()


def full_rate(drive):
    drive.unsteady, drive.wanted = 1, 1.5
    drive.cycle(ACTIVE)
    step = 0.3 if drive.angle < 0.0 else -0.3
    goal = 40.0 if step > 0.0 else -40.0
    drive.speed = 1.5
    while abs(drive.angle) < 39.0 or drive.angle * goal < 0.0:
        drive.angle = round(drive.angle + step, 2)
        before = drive.angle
        drive.repeat = True
        drive.cycle(ACTIVE)
        drive.angle = before
    drive.stop()


def degraded(drive):
    drive.run(DEGRADED, 80)
    drive.drive()


def stop_without_driving(drive):
    """A stop asked for before anybody engaged: nothing steers, the bit stands."""
    drive.stop('command_stop')
    drive.reset()
    drive.event('stop')
    drive.run(STOPPED, 30, stop=True)
    drive.reset()
    drive.engage()
    drive.drive()


def _loses_what_a_command_was_sent_in(drive, state):
    first = len(drive.items)
    drive.cycle(state)
    drive.items[first:] = [item for item in drive.items[first:]
                           if not (item[0] == 'frame' and item[2] in ('TP_COMMAND_INFO', 'TP_STATUS'))]


def hangs_after_its_command(drive):
    """What told the command's state does not come any more; the next state on the bus is that of a pilot that stopped."""
    _loses_what_a_command_was_sent_in(drive, ACTIVE)
    drive.run(STOPPED, 30, stop=True)
    drive.reset()
    drive.engage()
    drive.drive()


def hangs_after_its_first_command(drive):
    """The same with the first that steers: neither neighbour may, but the bus broke, and the one before was ARMED."""
    drive.stop()
    drive.reset()
    drive.engage()
    _loses_what_a_command_was_sent_in(drive, ACTIVE)
    drive.event('bus', 'down')
    drive.event('bus', 'up')
    drive.claim()
    drive.time += 250 * MS
    drive.run(STOPPED, 30, stop=True)


GOOD = [plain, lost_single_frames, repeated_commands, stop_and_go_again, stop_at_its_limit, override,
        feedback_at_its_limit, full_rate, degraded, stop_without_driving, hangs_after_its_command,
        hangs_after_its_first_command]


# ---- bad ones: (name, expected finding, what is done to a drive that has started)

def _last(drive, name):
    return next(item for item in reversed(drive.items) if item[0] == 'frame' and item[2] == name)


def _bent(drive, name, **bend):
    """One more cycle whose frame `name` carries something else."""
    drive.cycle(ACTIVE)
    _last(drive, name)[3].update(bend)


def _any_pilot_frame(drive):
    return drive.random.choice(['TP_COMMAND', 'TP_COMMAND_INFO', 'TP_STATUS'])


def wrong_length(drive):
    _bent(drive, _any_pilot_frame(drive), length=drive.random.randrange(8))


def remote_frame(drive):
    _bent(drive, _any_pilot_frame(drive), remote=True)


def wrong_crc(drive):
    _bent(drive, _any_pilot_frame(drive), flip=1 << drive.random.randrange(64))


def crc_of_another_frame(drive):
    _bent(drive, _any_pilot_frame(drive), data_id=drive.random.choice([0, 0x20, 0x21, 0x7F]))


def counter_stands(drive):
    name = _any_pilot_frame(drive)
    drive.cycle(ACTIVE)
    before = _last(drive, name)[3]['AliveCounter']
    _bent(drive, name, AliveCounter=before)


def counter_leaps(drive):
    """A step of 3, the first wrong one, to 14."""
    name = _any_pilot_frame(drive)
    drive.cycle(ACTIVE)
    before = _last(drive, name)[3]['AliveCounter']
    _bent(drive, name, AliveCounter=(before + drive.random.randrange(3, 15)) % 15)


def counter_of_15(drive):
    _bent(drive, _any_pilot_frame(drive), AliveCounter=15)


def value_out_of_range(drive):
    fields = drive.random.choice([{'ArticulationAngle': 45.01}, {'ArticulationAngle': -45.01}, {'Speed': 12.001},
                                  {'Acceleration': 5.025}])
    _bent(drive, 'TP_COMMAND', **fields)


def too_fast(drive):
    _bent(drive, 'TP_COMMAND', Speed=9.7222 + drive.random.choice([0.001, 0.5, 2.2]))


def too_fast_in_degraded(drive):
    drive.run(DEGRADED, 50)
    drive.cycle(DEGRADED)
    _last(drive, 'TP_COMMAND')[3].update(Speed=1.5 + drive.random.choice([0.001, 0.1, 1.0]))


def angle_leaps(drive):
    """From 0.32 deg within 20 ms: 15 deg/s are 0.30, and two roundings are 0.01."""
    before = _last(drive, 'TP_COMMAND')
    drive.repeat = True
    drive.cycle(ACTIVE)
    command = _last(drive, 'TP_COMMAND')
    seconds = (command[1] - before[1]) * 1e-6
    leap = math.ceil((15.0 * seconds + 0.0102) * 100.0) / 100.0 + drive.random.choice([0.0, 0.01, 0.3, 3.0])
    leap *= drive.random.choice([-1.0, 1.0])
    command[3]['ArticulationAngle'] = round(before[3]['ArticulationAngle'], 2) + leap


def begins_off_the_measured_angle(drive):
    drive.stop()
    drive.reset()
    drive.event('engage')
    drive.run(ARMED, 6)
    drive.cycle(ACTIVE)
    _last(drive, 'TP_COMMAND')[3]['ArticulationAngle'] += drive.random.choice([-1, 1]) * drive.random.choice([0.7, 5.0])


def winds_up_at_speed(drive):
    """Turns at a lawful rate to where 2.0 m/s^2 are left behind."""
    drive.wanted = drive.random.uniform(6.0, 9.0)
    drive.amplitude = 1.0
    drive.run(ACTIVE, 400)
    drive.amplitude, drive.rhythm = 60.0, 1000.0
    for _ in range(120):
        before = drive.angle
        drive.repeat = True
        drive.angle = before + 0.29
        drive.cycle(ACTIVE)


def speeds_up_in_a_bend(drive):
    """Holds an angle and goes on accelerating past 2.0 m/s^2."""
    drive.wanted, drive.repeat = 1.5, True
    while drive.angle < 25.0:  # wherever it began
        drive.angle += 0.29
        drive.cycle(ACTIVE)
    drive.wanted = drive.random.uniform(5.5, 8.0)
    drive.run(ACTIVE, 320)


def too_many_frames(drive):
    """The 17th set of one identifier within exactly 250 ms, or less."""
    first = _last(drive, 'TP_COMMAND')[1]
    start = drive.time
    spacing = (first + 250 * MS - start) // 17
    drive.angle = round(drive.angle, 2)
    for number in range(17):
        drive.time = start + number * spacing
        if number % 2 == 0:
            drive._truck(ACTIVE)
        drive.repeat = True
        drive._pilot(ACTIVE, False, PREVIEW, True)


def steers_before_it_may(drive):
    """Steering enabled in INIT, STANDBY, ARMED or STOPPED."""
    state = drive.random.choice([INIT, STANDBY, ARMED, STOPPED])
    drive.stop()
    if state in (STANDBY, ARMED):
        drive.reset()
    if state == ARMED:
        drive.event('engage')
    drive.cycle(state, stop=state == STOPPED)
    _last(drive, 'TP_COMMAND')[3]['SteeringEnable'] = 1


def steers_while_armed_and_hides_it(drive):
    drive.stop()
    drive.reset()
    drive.engage()
    _loses_what_a_command_was_sent_in(drive, ACTIVE)
    drive.run(STOPPED, 30, stop=True)


def drives_without_an_edge(drive):
    drive.stop()
    drive.reset()
    drive.run(ACTIVE, 1)


def drives_on_after_a_stop(drive):
    """Out of STOPPING back to ACTIVE: the reset is told, the engagement is missing."""
    drive.event('command_stop')
    drive.run(STOPPING, 5, stop=True, source=DEAD_RECKONING)
    drive.event('reset')
    drive.run(ACTIVE, 1)


def steers_on_old_feedback(drive):
    """One frame later than 60 ms after the truck's last, by 1 us or more: of all three, or of one of them."""
    lost = drive.random.choice(['all', 'TRUCK_FEEDBACK', 'TRUCK_MOTION', 'TRUCK_STATUS'])
    heard = _last(drive, 'TRUCK_FEEDBACK')[1]
    first = len(drive.items)
    drive.repeat = True
    drive.run(ACTIVE, 2)
    drive.time = heard + 60 * MS + drive.random.choice([1, 10, 1000])
    drive._pilot(ACTIVE, False, PREVIEW, False)
    drive.items[first:] = [item for item in drive.items[first:]
                           if not (item[0] == 'frame' and item[2].startswith('TRUCK') and lost in ('all', item[2]))]


def steers_on_corrupt_feedback(drive):
    """The truck's frames come, but none of them is right."""
    first = len(drive.items)
    drive.run(ACTIVE, 5)
    for item in drive.items[first:]:
        if item[0] == 'frame' and item[2] == 'TRUCK_FEEDBACK':
            item[3]['flip'] = 1 << drive.random.randrange(64)


def steers_on_an_old_measurement(drive):
    """A stamp that is more than 300 ms old (and one of the wire's millisecond)."""
    drive.scan_age = drive.random.choice([302, 320, 1000, 30000]) * MS
    drive.run(ACTIVE, 1)


def lies_about_its_measurement(drive):
    """Fresh stamps, though the log of events tells of no good measurement for more than 300 ms."""
    first = len(drive.items)
    drive.run(ACTIVE, 20)
    drive.items[first:] = [item for item in drive.items[first:] if item[0] == 'frame']


def no_source(drive):
    _bent(drive, 'TP_COMMAND_INFO', Source=drive.random.choice([0, HOLD]))


def stop_bit_late(drive):
    """The first frame without the bit later than 20 ms after the request, by 1 us or more."""
    drive.cycle(ACTIVE)
    time = _last(drive, 'TP_COMMAND')[1]
    request = time - 20 * MS - drive.random.choice([1, 10, 1000])
    word = drive.random.choice(['stop', 'command_stop', 'release'])
    place = next(i for i, item in enumerate(drive.items) if item[1] > request)
    drive.items.insert(place, ('event', request, [word]))


def stop_bit_gone(drive):
    """Stopped, and the bit falls without a reset."""
    drive.stop()
    drive.run(STANDBY, 1)


def sequence_decreases(drive):
    drive.cycle(ACTIVE)
    info = _last(drive, 'TP_COMMAND_INFO')
    info[3]['Sequence'] -= drive.random.choice([2, 3, 50])


def foreign_sender(drive):
    """A frame under one of our identifiers, right in everything, that the log of events tells of."""
    drive.cycle(ACTIVE)
    name = _any_pilot_frame(drive)
    fields = dict(_last(drive, name)[3])
    drive.time += MS
    drive.items.append(('foreign', drive.time, name, fields))
    drive.frame(name, **fields)


def steers_against_the_operator(drive):
    if drive.random.random() < 0.5:
        drive.override = True
    else:
        drive.key_off = True
    drive.run(ACTIVE, 4)


def hides_its_state(drive):
    first = len(drive.items)
    drive.run(ACTIVE, 5)
    name = drive.random.choice(['TP_STATUS', 'TP_COMMAND_INFO'])
    drive.items[first:] = [item for item in drive.items[first:] if not (item[0] == 'frame' and item[2] == name)]


BAD = [(wrong_length, 'a length'), (remote_frame, 'a length'), (wrong_crc, 'a crc'), (crc_of_another_frame, 'a crc'),
       (counter_stands, 'a counter'), (counter_leaps, 'a counter'), (counter_of_15, 'a range'),
       (value_out_of_range, 'a range'), (too_fast, 'b speed'), (too_fast_in_degraded, 'b speed'),
       (angle_leaps, 'b rate'), (begins_off_the_measured_angle, 'b rate'),
       (winds_up_at_speed, 'b lateral acceleration'), (speeds_up_in_a_bend, 'b lateral acceleration'),
       (too_many_frames, 'b period'), (steers_before_it_may, 'c steers'),
       (steers_while_armed_and_hides_it, 'c steers'),
       (drives_without_an_edge, 'c no re-arm edge'), (drives_on_after_a_stop, 'c no re-arm edge'),
       (steers_on_old_feedback, 'c steers on old feedback'), (steers_on_corrupt_feedback, 'c steers on old feedback'),
       (steers_on_an_old_measurement, 'c old measurement'), (lies_about_its_measurement, 'c old measurement'),
       (no_source, 'c nobody steers'), (stop_bit_late, 'c no stop bit'), (stop_bit_gone, 'c no stop bit'),
       (sequence_decreases, 'd sequence'), (foreign_sender, 'e foreign'),
       (steers_against_the_operator, 'c steers against the operator'), (hides_its_state, 'c * not told')]


# ---- on a J1939 network, beside the ones above

def defends_its_address(drive):
    for _ in range(3):
        drive.claim(OWN_NAME + drive.random.choice([1, 1000]))
        drive.run(ACTIVE, drive.random.randrange(1, 12))
        drive.claim()
        drive.raw(REQUEST)
        drive.run(ACTIVE, 2)
        drive.claim()
        drive.drive(20)


def loses_its_address(drive):
    """And is silent at once, tells it, is asked and tells it again; then somebody starts it anew."""
    drive.claim(OWN_NAME - 1)
    if drive.random.random() < 0.5:
        drive.run(ACTIVE, 2)
    drive.silent_command = True
    for _ in range(2):
        drive.run(STOPPED, drive.random.randrange(8))
        drive.claim(source=254)
        drive.run(STOPPED, 50)
        drive.raw(REQUEST)
    drive.claim(source=254)
    drive.run(STOPPED, 20)
    drive.event('start')
    drive.claim()
    drive.run(STOPPED, 13)
    drive.silent_command = drive.repeat = False
    drive.speed, drive.sequence = 0.0, 0
    drive.power_up()
    drive.engage()
    drive.drive()


def strangers_on_the_network(drive):
    """Frames of other nodes, of the truck's groups too, are nothing of ours; a priority says nothing."""
    for text in ('0CFF2055#1122334455667788', '18FEF103#FFFFFFFFFFFFFFFF', '18EEFF55#0000000000000000', '110#00',
                 '18EA5581#00EE00', '0CF00400#FFFFFFFFFFFFFFFF'):
        drive.raw(text)
        drive.cycle(ACTIVE)
    drive.drive()


def bus_back_and_claimed_anew(drive):
    drive.stop()
    drive.event('bus', 'down')
    drive.time += 500 * MS
    drive.event('bus', 'up')
    drive.claim()
    drive.time += 250 * MS
    drive.run(STOPPED, 20, stop=True)


J1939_GOOD = [defends_its_address, loses_its_address, strangers_on_the_network, bus_back_and_claimed_anew]


def _bus_dip(drive):
    drive.stop()
    drive.event('bus', 'down')
    drive.time += 500 * MS
    drive.event('bus', 'up')


def speaks_without_a_claim(drive):
    _bus_dip(drive)
    drive.run(STOPPED, 1, stop=True)


def speaks_too_soon_after_its_claim(drive):
    """At 249.999 ms at the latest."""
    _bus_dip(drive)
    drive.claim()
    drive.time += drive.random.choice([0, 100 * MS, 250 * MS - 13 * MS - 1])
    drive.unsteady = 1
    drive.run(STOPPED, 1, stop=True)


def speaks_after_it_lost_its_address(drive):
    """One frame 60 ms and 1 us after the lower NAME, or later."""
    drive.claim(OWN_NAME - drive.random.choice([1, 500]))
    lost = drive.time
    drive.silent_command = True
    drive.run(STOPPED, 2)
    drive.time, drive.silent_command = lost + 60 * MS + drive.random.choice([1, 1000, 100 * MS]), False
    drive._pilot(STOPPED, True, HOLD, False)


def claims_a_lost_address_again(drive):
    drive.claim(OWN_NAME - 1)
    drive.silent_command = True
    drive.run(STOPPED, 10)
    drive.claim()


def keeps_its_address_without_a_word(drive):
    drive.claim(OWN_NAME + 1)
    drive.run(ACTIVE, 15)


def ignores_a_request(drive):
    drive.raw(drive.random.choice([REQUEST, '18EA80FE#00EE00']))
    drive.run(ACTIVE, 15)


def loses_its_address_without_a_word(drive):
    drive.claim(OWN_NAME - 1)
    drive.silent_command = True
    drive.run(STOPPED, 15)
    drive.raw('18FEF103#FFFFFFFFFFFFFFFF')


def tells_its_loss_again_and_again(drive):
    drive.claim(OWN_NAME - 1)
    drive.silent_command = True
    drive.run(STOPPED, 5)
    drive.claim(source=254)
    drive.run(STOPPED, 5)
    drive.claim(source=254)


def our_group_from_another_address(drive):
    drive.raw(drive.random.choice(['0CFF1055', '18FF1181', '18FF12FE', '00FF1000']) + '#0000000000000000')


def our_address_with_another_group(drive):
    drive.raw(drive.random.choice(['18FEF180', '0CFF2080', '00000080', '18EAFF80']) + '#00EE00')


J1939_BAD = [(speaks_without_a_claim, 'f not claimed'), (speaks_too_soon_after_its_claim, 'f not claimed'),
             (speaks_after_it_lost_its_address, 'f address lost'), (claims_a_lost_address_again, 'f claims again'),
             (keeps_its_address_without_a_word, 'f claim not defended'), (ignores_a_request, 'f request not answered'),
             (loses_its_address_without_a_word, 'f loss not told'),
             (tells_its_loss_again_and_again, 'f loss told unasked'), (our_group_from_another_address, 'e foreign'),
             (our_address_with_another_group, 'e foreign')]


# ---- on the wire

def frame_text(layouts, name, fields):
    layout = layouts[name]
    extended = layout.identifier >> 31
    number = f'{layout.identifier & 0x1FFFFFFF:08X}' if extended else f'{layout.identifier:03X}'
    if fields.get('remote'):
        return f'{number}#R8'
    data = 0
    for signal, value in fields.items():
        if signal in layout.signals:
            data |= layout.signals[signal].encoded(value)
    data |= frame_crc(data, fields.get('data_id', layout.data_id))
    data ^= fields.get('flip', 0)
    return f'{number}#{data.to_bytes(8, "little")[:fields.get("length", 8)].hex().upper()}'


def log_lines(items, dbc_file):
    """The lines of a log with its events among the frames."""
    layouts = dbc.read(dbc_file)
    for kind, time, *rest in items:
        stamp = f'({time // 1000000}.{time % 1000000:06d})'
        if kind == 'event':
            yield f'{stamp} event {" ".join(rest[0])}'
        elif kind == 'raw':
            yield f'{stamp} can0 {rest[0]}'
        elif kind == 'foreign':
            yield f'{stamp} event foreign {frame_text(layouts, *rest)}'
        else:
            yield f'{stamp} can0 {frame_text(layouts, *rest)}'
