"""PTX, as NVRTC makes it of Warp's kernels, put into C++ whose threads run one after another.

All memory is the host's; threads share one piece of shared memory. What needs threads side by side (barriers, votes, shuffles) is
refused, and so is every instruction that is not known here. Reference: NVIDIA, Parallel Thread Execution ISA.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from paper_gpu.instructions import Registers, named, statement

_PRELUDE = r"""
typedef unsigned char u8; typedef signed char s8; typedef unsigned short u16; typedef short s16;
typedef unsigned int u32; typedef int s32; typedef unsigned long long u64; typedef long long s64;
typedef float f32; typedef double f64; typedef bool pred; typedef unsigned __int128 u128; typedef __int128 s128;

static u8 shared_memory[1 << 16] __attribute__((aligned(256)));

template <class T, class F> static inline T bits(F from) { T to; __builtin_memcpy(&to, &from, sizeof(T)); return to; }
template <class T> static inline T load(u64 place) { T value; __builtin_memcpy(&value, (void*)place, sizeof(T)); return value; }
template <class T> static inline void store(u64 place, T value) { __builtin_memcpy((void*)place, &value, sizeof(T)); }
template <class T> static inline T whole(f64 x) {
    const bool sign = T(-1) < T(0);
    const T top = sign ? T((u64(1) << (8 * sizeof(T) - 1)) - 1) : T(-1), bottom = sign ? T(-top - 1) : T(0);
    return x != x ? T(0) : x >= f64(top) ? top : x <= f64(bottom) ? bottom : T(x);
}
"""
_VARIABLE = re.compile(
    r"\.(global|const|shared|local)\s+(?:\.align\s+\d+\s+)?\.(\w+)\s+([\w$]+)(?:\[(\d+)\])?(?:\s*=\s*(.*))?;", re.S
)
_PARAMETER = re.compile(r"\.param\s+(?:\.align\s+\d+\s+)?\.(\w+)\s+([\w$]+)(?:\[(\d+)\])?")
_FUNCTION = re.compile(r"\.func\s+(?:\([^)]*\)\s*)?([\w$]+)\s*\((.*)\)", re.S)
_CALL = re.compile(r"call(?:\.uni)?\s+(?:\((\w+)\)\s*,\s*)?([\w$]+)\s*,\s*\(\s*([^)]*)\)", re.S)
_ALIGNED = "__attribute__((aligned(16)))"


@dataclass
class Program:
    """A translated module.

    Attributes:
        source: C++.
        entries: kernels by name, with the bytes that each argument takes. A kernel is called with the places of its arguments,
            the number of blocks, threads a block, the first thread to run, and the step from one to the next.
    """

    source: str
    entries: dict[str, list[int]]


@dataclass
class _Translation:
    lines: Iterator[str]
    places: dict[str, str] = field(default_factory=dict)  # names of memory, and the addresses they stand for
    shared: int = 256  # bytes of shared memory taken; the first stay free, as address 0 may mean none
    out: list[str] = field(default_factory=lambda: [_PRELUDE])
    entries: dict[str, list[int]] = field(default_factory=dict)

    def module(self) -> Program:
        for line in self.lines:
            if line.startswith((".version", ".target", ".address_size")):
                continue
            if ".entry" in line or ".func" in line:
                self._function(line)
            else:
                self.out.append(self._variable(line))
        return Program("\n".join(self.out), self.entries)

    def _variable(self, line: str) -> str:
        """A declaration of memory; of shared memory only the place is told."""
        space, kind, name, number, value = _VARIABLE.search(self._whole(line)).groups()
        size = int(number or 1) * _size(kind)
        if space == "shared":
            self.places[name] = f"u64({self.shared})"
            self.shared += -(-size // 256) * 256
            return f'static_assert({self.shared} <= sizeof(shared_memory), "shared memory");'
        scope = "" if space == "local" else "static "
        self.places[name] = f"u64(&{_plain(name)})"
        if number:
            return f"{scope}{_unsigned(kind)} {_plain(name)}[{number}] {_ALIGNED}{f' = {value}' if value else ''};"
        return f"{scope}{_unsigned(kind)} {_plain(name)} {_ALIGNED}{f' = {_bits(value)}' if value else ''};"

    def _whole(self, line: str) -> str:
        """What starts on this line, to its semicolon."""
        while not line.endswith(";"):
            line += " " + next(self.lines)
        return line

    def _function(self, head: str) -> None:
        """A kernel, or a function that kernels call, or the announcement of one."""
        while (line := next(self.lines)) not in ("{", ";"):
            head += " " + line
        entry = ".entry" in head
        name, parameters = re.search(r"\.entry\s+([\w$]+)(.*)", head, re.S).groups() if entry else _FUNCTION.search(head).groups()
        sizes = []
        for kind, parameter, number in _PARAMETER.findall(parameters):
            self.places[parameter] = f"arguments[{len(sizes)}]"
            sizes.append(int(number or 1) * _size(kind))
        self.places["func_retval0"] = "result"
        signature = f"static void run_{name}(const u64* arguments, u64 result, u32 block, u32 thread, u32 blocks, u32 threads)"
        if line == ";":
            self.out.append(f"{signature};")
            return
        self.out += [f"{signature} {{", "u32 carry = 0;", *self._body(), "}"]
        if entry:
            self.entries[name] = sizes
            self.out.append(
                f'extern "C" void {name}(const u64* arguments, u32 blocks, u32 threads, u64 first, u64 step) {{'
                "const u64 number = u64(blocks) * threads;"
                "for (u64 k = 0, i = first; k < number; ++k, i = (i + step) % number)"
                f"run_{name}(arguments, 0, u32(i / threads), u32(i % threads), blocks, threads); }}"
            )

    def _body(self) -> Iterator[str]:
        """What stands between the braces of a function, those of scopes within it kept."""
        registers, depth, seen = Registers(), 1, []
        for line in self.lines:
            depth += (line == "{") - (line == "}")
            if depth == 0:
                break
            if line in "{}":
                seen.append(line)
            elif line.startswith(".reg"):
                kind, names = re.match(r"\.reg \.(\w+)\s+(.*);", line, re.S).groups()
                seen += [f"{_unsigned(kind)} {', '.join(registers.declare(kind, names))};"]
            elif line.startswith(".param"):
                _, name, number = _PARAMETER.match(line).groups()
                self.places[name] = f"u64(&{name})"
                seen.append(f"u8 {name}[{number or 8}] {_ALIGNED};")
            elif line.startswith((".local", ".shared")):
                seen.append(self._variable(line))
            elif line.startswith(".pragma"):
                continue
            elif label := re.match(r"([\w$]+):$", line):
                seen.append(f"{_plain(label.group(1))}:;")
            else:
                seen.append(self._statement(self._whole(line)[:-1], registers))
        return iter(seen)

    def _statement(self, line: str, registers: Registers) -> str:
        if call := _CALL.match(line):
            result, name, given = call.groups()
            given = ", ".join(self.places[one.strip()] for one in given.split(",") if one.strip())
            rest = f"{self.places[result] if result else 0}, block, thread, blocks, threads"
            return f"{{ const u64 given[] = {{{given}}}; run_{name}(given, {rest}); }}"
        turned, guard, told = re.match(r"(?:@(!?)(%p\d+)\s+)?(.*)", line, re.S).groups()
        done = statement(told, registers, self.places)
        return f"if ({turned}{named(guard)}) {{ {done} }}" if guard else done


def translate(text: str) -> Program:
    """Translate a module.

    Raises:
        ValueError: if it holds an instruction that is not known here.
    """
    text = re.sub(r"//[^\n]*", "", text).replace("\0", "")
    text = re.sub(r"(?m)^(\s*)\{ (.*;) \}\s*;?$", r"\1\2", text)  # assembly written within CUDA
    lines = (line.strip() for line in text.split("\n"))
    return _Translation(iter([line for line in lines if line])).module()


def _size(kind: str) -> int:
    return int(kind[1:]) // 8


def _unsigned(kind: str) -> str:
    """The type in C++ of memory and registers."""
    return kind if kind[0] in "fp" else f"u{kind[1:]}"


def _plain(name: str) -> str:
    return name.replace("$", "_")


def _bits(value: str) -> str:
    """A constant; of numbers with a point PTX tells the bits."""
    kind = {"0f": "f32", "0d": "f64"}.get(value[:2])
    return f"bits<{kind}>({'u32' if kind == 'f32' else 'u64'}(0x{value[2:]}ull))" if kind else value
