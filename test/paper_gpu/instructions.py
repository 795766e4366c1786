"""One instruction of PTX as a statement of C++."""

import re
from collections.abc import Callable

_SPECIAL = {"%tid": "thread", "%ntid": "threads", "%ctaid": "block", "%nctaid": "blocks"}
_COMPARED = {"eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">="}
_JOINED = {"and": "&&", "or": "||", "xor": "!="}
_INTEGRAL = {"rni": "rint", "rzi": "trunc", "rmi": "floor", "rpi": "ceil"}
_HIGH = {"u32": "u64", "s32": "s64", "u64": "u128", "s64": "s128", "u16": "u32", "s16": "s32"}


def named(register: str) -> str:
    """What a register is called in C++, where ``f32`` is a type."""
    return register.replace("%", "") + "_"


class Registers:
    """Registers of a function: their types by name, and by prefix where there is a row of them."""

    def __init__(self):
        self._types: dict[str, str] = {}

    def declare(self, kind: str, names: str) -> list[str]:
        """Take note of ``%r<5>`` or ``%a, %b``; return their names in C++."""
        declared = []
        for name, number in re.findall(r"([%\w]+)(?:<(\d+)>)?", names):
            self._types[name] = kind
            declared += [named(f"{name}{k}") for k in range(int(number))] if number else [named(name)]
        return declared

    def type(self, name: str) -> str:
        return self._types.get(name) or self._types[re.match(r"%[a-z]+", name).group()]


class _Instruction:
    """An instruction split into its name, the words behind it, its type and its operands."""

    def __init__(self, text: str, registers: Registers, places: dict[str, str]):
        operation, operands = re.match(r"([\w.:]+)\s*(.*)$", text, re.S).groups()
        self.name, *self.words = operation.split(".")
        self.kind = self.words[-1] if self.words else ""
        self.operands = re.findall(r"\{[^}]*\}|\[[^\]]*\]|[^,\s][^,]*", operands)
        self.registers, self.places = registers, places

    def value(self, which: int | str, kind: str | None = None) -> str:
        """An operand as a value of a type, that of the instruction if not told."""
        kind = _in_c(kind or self.kind)
        told = (self.operands[which] if isinstance(which, int) else which).strip()
        if told[0] == "!":
            return f"(!{self.value(told[1:], kind)})"
        if told.startswith("%") and told.split(".")[0] in _SPECIAL:
            name, axis = told.split(".")
            along = _SPECIAL[name] if axis == "x" else "1" if name.startswith("%n") else "0"
            return f"{kind}({along})"
        if told.startswith("%"):
            return _as(kind, named(told), _in_c(self.registers.type(told)))
        if found := re.match(r"0[fd]([0-9A-Fa-f]+)$", told):
            held = f"u{4 * len(found.group(1))}"
            return _as(kind, f"{held}(0x{found.group(1)}ull)", held)
        if re.match(r"-?\d+$", told):
            return f"{kind}({int(told) % 2**64}ull)"
        if told in self.places:
            return f"{kind}({self.places[told]})"
        raise ValueError(f"operand {told}")

    def place(self, which: int) -> str:
        """The address in brackets."""
        base, offset = re.match(r"\[\s*([^\]+]+)(?:\+(-?\d+))?\s*\]", self.operands[which]).groups()
        start = "u64(shared_memory) + " if "shared" in self.words else ""
        return f"{start}{self.value(base, 'u64')} + {offset or 0}"

    def put(self, value: str, kind: str | None = None, into: str | None = None) -> str:
        """The statement that a register, the first operand if not told, takes a value of a type."""
        into = (into or self.operands[0]).strip()
        if into == "_":
            return ";"
        return f"{named(into)} = {_as(_in_c(self.registers.type(into)), value, _in_c(kind or self.kind))};"

    def parts(self, which: int) -> list[str]:
        """The registers in braces, or the only one."""
        return [one.strip() for one in self.operands[which].strip("{} ").split(",")]

    @property
    def real(self) -> bool:
        return self.kind[0] == "f"

    @property
    def unsigned(self) -> str:
        return f"u{self.kind[1:]}"


def _in_c(kind: str) -> str:
    return f"u{kind[1:]}" if kind[0] == "b" else kind


def _as(kind: str, value: str, held: str) -> str:
    """A value in another type: its bits where one is a real number and the other is not, with what is too many cut off."""
    if kind == held:
        return value
    if (kind[0] == "f") != (held[0] == "f"):
        return f"bits<{kind}>({value})"
    return f"{kind}({value})"


def _load(one: _Instruction) -> str:
    size, registers = int(one.kind[1:]) // 8, one.parts(0)
    loaded = (one.put(f"load<{_in_c(one.kind)}>(place + {k * size})", into=into) for k, into in enumerate(registers))
    return f"{{ const u64 place = {one.place(1)}; {' '.join(loaded)} }}"


def _store(one: _Instruction) -> str:
    size = int(one.kind[1:]) // 8
    stored = (f"store<{_in_c(one.kind)}>(place + {k * size}, {one.value(told)});" for k, told in enumerate(one.parts(1)))
    return f"{{ const u64 place = {one.place(0)}; {' '.join(stored)} }}"


def _move(one: _Instruction) -> str:
    if one.operands[0][0] == "{":
        parts = one.parts(0)
        size = int(one.kind[1:]) // len(parts)
        taken = (one.put(f"u{size}(all >> {size * k})", f"u{size}", into) for k, into in enumerate(parts))
        return f"{{ const {one.unsigned} all = {one.value(1, one.unsigned)}; {' '.join(taken)} }}"
    if one.operands[1][0] == "{":
        parts = one.parts(1)
        size = int(one.kind[1:]) // len(parts)
        return one.put(
            " | ".join(f"({one.unsigned}({one.value(told, f'u{size}')}) << {size * k})" for k, told in enumerate(parts))
        )
    return one.put(one.value(1))


def _convert(one: _Instruction) -> str:
    to, held = one.words[-2:]
    value = one.value(1, held)
    for word, function in _INTEGRAL.items():
        if word in one.words and held[0] == "f":
            value = f"__builtin_{function}(f64({value}))"
    if held[0] == "f" and to[0] != "f":
        value = f"whole<{_in_c(to)}>({value})"
    if "sat" in one.words:
        value = f"__builtin_fmin(__builtin_fmax({value}, 0.0), 1.0)"
    return one.put(f"{_in_c(to)}({value})", to)


def _compare(one: _Instruction) -> str:
    word, left, right = one.words[0], one.value(1), one.value(2)
    unordered = one.real and word not in _COMPARED  # true also where one is not a number
    told = f"{left} {_COMPARED[word[:2]]} {right}"
    if unordered:
        told = f"{left} != {left} || {right} != {right} || {told}"
    elif one.real and word == "ne":
        told = f"{left} < {right} || {left} > {right}"
    joined = f" {_JOINED[one.words[1]]} ({one.value(3, 'pred')})" if one.words[1] in _JOINED else ""
    return one.put(f"({told}){joined}", "pred")


def _sum(one: _Instruction) -> str:
    """Sums and differences, products with a summand too, with the carry of the one before or for the one after."""
    if one.real:
        if one.name in ("mad", "fma"):
            letter = "f" if one.kind == "f32" else ""
            return one.put(f"__builtin_fma{letter}({one.value(1)}, {one.value(2)}, {one.value(3)})")
        return one.put(f"{one.value(1)} {'+' if one.name == 'add' else '-'} {one.value(2)}")
    kind, sign = one.unsigned, "-" if one.name.startswith("sub") else "+"
    if one.name.startswith("mad"):
        first, kind = _product(one)
        second = one.value(3, kind)
    else:
        first, second = one.value(1, kind), one.value(2, kind)
    carried = f" {sign} carry" if one.name in ("addc", "subc", "madc") else ""
    kept = f"carry = u32(sum >> {kind[1:]}) & 1;" if "cc" in one.words else ""
    return f"{{ const u128 sum = u128({first}) {sign} u128({second}){carried}; {kept} {one.put(f'{kind}(sum)', kind)} }}"


def _product(one: _Instruction) -> tuple[str, str]:
    """A product of whole numbers, its lower half, upper half or all of it, and its type."""
    if "lo" in one.words:
        return f"{one.unsigned}({one.value(1, one.unsigned)} * u64({one.value(2, one.unsigned)}))", one.unsigned
    high = _HIGH[_in_c(one.kind)]
    product = f"({high}({one.value(1)}) * {high}({one.value(2)}))"
    if "wide" in one.words:
        return f"u{high[1:]}({product})", f"u{high[1:]}"
    return f"{one.unsigned}({product} >> {one.kind[1:]})", one.unsigned


def _multiply(one: _Instruction) -> str:
    return one.put(f"{one.value(1)} * {one.value(2)}") if one.real else one.put(*_product(one))


def _shift(one: _Instruction) -> str:
    size, by = int(one.kind[1:]), one.value(2, "u32")
    if one.kind[0] == "s":
        return one.put(f"{one.value(1)} >> ({by} < {size} ? {by} : {size - 1})")
    return one.put(
        f"{by} < {size} ? {one.unsigned}({one.value(1)} {'<<' if one.name == 'shl' else '>>'} {by}) : {one.unsigned}(0)"
    )


def _insert_bits(one: _Instruction) -> str:
    start, length = one.value(3, "u32"), one.value(4, "u32")
    mask = f"{one.unsigned}(((u128(1) << {length}) - 1) << {start})"
    value = f"({one.value(2)} & ~mask) | ({one.unsigned}(u128({one.value(1)}) << {start}) & mask)"
    return f"{{ const {one.unsigned} mask = {mask}; {one.put(value)} }}"


def _atomic(one: _Instruction) -> str:
    told = [one.value(k) for k in range(2, len(one.operands))]
    new = {
        "add": "old + {0}", "and": "old & {0}", "or": "old | {0}", "exch": "{0}", "cas": "old == {0} ? {1} : old",
        "min": "old < {0} ? old : {0}", "max": "old > {0} ? old : {0}",
    }  # fmt: skip
    how = next(word for word in one.words if word in new)
    kind = _in_c(one.kind)
    return (
        f"{{ const u64 place = {one.place(1)}; const {kind} old = load<{kind}>(place); "
        f"store<{kind}>(place, {new[how].format(*told)}); {one.put('old')} }}"
    )


def _extreme(one: _Instruction) -> str:
    if one.real:
        return one.put(f"__builtin_f{one.name}({one.value(1)}, {one.value(2)})")
    return one.put(f"{one.value(1)} {'<' if one.name == 'min' else '>'} {one.value(2)} ? {one.value(1)} : {one.value(2)}")


def _of_one(formula: str, whole: str | None = None) -> Callable[[_Instruction], str]:
    """What depends on one value; ``whole`` for whole numbers, if it is another."""
    return lambda one: one.put((formula if one.real or whole is None else whole).format(one.value(1)))


def _of_two(formula: str) -> Callable[[_Instruction], str]:
    return lambda one: one.put(formula.format(one.value(1), one.value(2)))


def _count(function: str) -> Callable[[_Instruction], str]:
    return lambda one: one.put(function.format(one.value(1), one.kind[1:]), "u32")


def _convert_address(one: _Instruction) -> str:
    way = "-" if "to" in one.words else "+"
    return one.put(f"{one.value(1)} {way} u64(shared_memory)" if "shared" in one.words else one.value(1))


_KNOWN: dict[str, Callable[[_Instruction], str]] = {
    "ld": _load, "st": _store, "mov": _move, "cvta": _convert_address, "cvt": _convert, "setp": _compare,
    "add": _sum, "addc": _sum, "sub": _sum, "subc": _sum, "mad": _sum, "madc": _sum, "fma": _sum, "mul": _multiply,
    "shl": _shift, "shr": _shift, "bfi": _insert_bits, "atom": _atomic, "min": _extreme, "max": _extreme,
    "selp": lambda one: one.put(f"{one.value(3, 'pred')} ? {one.value(1)} : {one.value(2)}"),
    "bra": lambda one: f"goto {one.operands[0].replace('$', '_')};",
    "ret": lambda one: "return;",
    "and": _of_two("{} & {}"), "or": _of_two("{} | {}"), "xor": _of_two("{} ^ {}"),
    "div": _of_two("{} / {}"), "rem": _of_two("{} % {}"),
    "not": lambda one: one.put(f"{'!' if one.kind == 'pred' else '~'}{one.value(1)}"),
    "neg": _of_one("-{}"), "abs": _of_one("__builtin_fabs({})", "({0} < 0 ? -{0} : {0})"),
    "sqrt": _of_one("__builtin_sqrt({})"), "rcp": _of_one("1 / {}"), "rsqrt": _of_one("1 / __builtin_sqrt({})"),
    "copysign": _of_two("__builtin_copysign({1}, {0})"),
    "popc": _count("__builtin_popcountll({})"), "clz": _count("({0} ? __builtin_clzll({0}) + {1} - 64 : {1})"),
}  # fmt: skip


def statement(text: str, registers: Registers, places: dict[str, str]) -> str:
    """Translate.

    Args:
        text: instruction without guard and semicolon.
        registers: that are known in its function.
        places: addresses of memory by name.

    Raises:
        ValueError: if it is not known.
    """
    one = _Instruction(text, registers, places)
    if one.name not in _KNOWN:
        raise ValueError(f"{text}: not known")
    try:
        return _KNOWN[one.name](one)
    except (LookupError, ValueError, AttributeError) as error:
        raise ValueError(f"{text}: {error!r}") from error
