"""The pilot's address on a J1939 network, as docs/can.md ("The address") tells of it: what clause (f) is judged by."""
EXTENDED = 0x80000000
PRIORITY = 7 << 26
REQUEST, CLAIMED = 0xEA00, 0xEE00
NULL_ADDRESS, GLOBAL_ADDRESS = 254, 255
MS = 1000  # [us]
FAR = 10**18
CONTENTION = 250 * MS  # from the claim to anything else
SILENCE_LIMIT = 60 * MS  # from the lower NAME to the last frame: a tick, and what was on its way
ANSWER_LIMIT = 250 * MS  # to a request, a higher NAME, a loss


def group_of(identifier):
    """The parameter group's number; its lowest byte is 0 where that is a destination."""
    group = identifier >> 8 & 0x3FFFF
    return group & ~0xFF if group >> 8 & 0xFF < 240 else group


def destination_of(identifier):
    return identifier >> 8 & 0xFF if identifier >> 16 & 0xFF < 240 else GLOBAL_ADDRESS


class Network:
    """`name`: the pilot's NAME, None: whoever first claims its address. `joined_late`: no log tells of the start, the
    address counts as claimed."""

    def __init__(self, pilots, name, joined_late, find):
        self.address = next(iter(pilots)) & 0xFF
        self.groups = {group_of(identifier) for identifier in pilots}
        self.name, self.joined_late, self.find = name, joined_late, find
        self.start()

    def start(self):
        self.may_speak = -FAR if self.joined_late else None  # from when on; None: no claim yet
        self.lost = None  # since when
        self.loss_owed = None  # since when a cannot-claim is
        self.causes = 0  # to send one, less those sent: one may answer several
        self.asked = None  # (since when, what) an answer is due

    def bus(self, time, works):
        self.may_speak = self.asked = None
        if self.loss_owed is not None:
            self.loss_owed = time if works else FAR

    def is_foreign(self, identifier):
        """A frame that nobody but the pilot may send, from an address that is not its, or that it does not send."""
        ours = identifier & 0xFF == self.address
        if group_of(identifier) in self.groups:
            return not ours
        return ours and self.lost is None and group_of(identifier) != CLAIMED

    def hear(self, time, identifier, length, data, text):
        """True when the frame was of the network's management."""
        if self.loss_owed is not None and time - self.loss_owed > ANSWER_LIMIT:
            self.find(time, 'loss not told', f'for {(time - self.loss_owed) / MS:g} ms', text)
            self.loss_owed = None
        group, source = group_of(identifier), identifier & 0xFF
        if group == CLAIMED:
            if length == 8 and source == self.address:
                self._claim(time, data, text)
            elif length == 8 and source == NULL_ADDRESS and data == self.name:
                self._cannot_claim(time, text)
            return True
        if group != REQUEST or length != 3 or data & 0xFFFFFF != CLAIMED or source == self.address:
            return False
        if destination_of(identifier) in (GLOBAL_ADDRESS, self.address):
            if self.lost is not None:
                self.loss_owed = time if self.loss_owed is None else self.loss_owed
                self.causes += 1
            elif self.may_speak is not None:
                self.asked = self.asked or (time, 'request not answered')
        return True

    def _claim(self, time, name, text):
        if self.name is None:
            self.name = name
        if name == self.name:
            if self.lost is not None and time - self.lost > SILENCE_LIMIT:
                self.find(time, 'claims again', 'an address that was lost', text)
            if self.may_speak is None or time < self.may_speak:
                self.may_speak = time + CONTENTION
            self.asked = None
        elif self.lost is None and name < self.name:
            self.lost = self.loss_owed = time
            self.causes = 1
            self.asked = None
        elif self.lost is None and self.may_speak is not None:
            self.asked = self.asked or (time, 'claim not defended')

    def _cannot_claim(self, time, text):
        if self.causes == 0:
            self.find(time, 'loss told unasked', 'cannot claim', text)
        self.causes = max(self.causes - 1, 0)
        self.loss_owed = None

    def pilot_frame(self, time, jitter, text):
        """Judges when one of the pilot's frames comes, not what it holds."""
        if self.lost is not None:
            if time - self.lost > SILENCE_LIMIT + jitter:
                self.find(time, 'address lost', f'{(time - self.lost) / MS:g} ms ago', text)
        elif self.may_speak is None:
            self.find(time, 'not claimed', 'no claim of the address before', text)
        elif time < self.may_speak - jitter:
            self.find(time, 'not claimed', f'{(self.may_speak - time) / MS:g} ms too soon after the claim', text)
        if self.asked and time - self.asked[0] > ANSWER_LIMIT + jitter:
            self.find(time, self.asked[1], f'for {(time - self.asked[0]) / MS:g} ms', text)
            self.asked = None
