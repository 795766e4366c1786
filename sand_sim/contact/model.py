"""The choice of contact laws, one per slot, and how their memories lie side by side in a contact."""

from dataclasses import dataclass

from sand_sim.contact.cohesion import COHESION_LAWS
from sand_sim.contact.contact import ContactTypes, contact_type, pair_type
from sand_sim.contact.law import Law
from sand_sim.contact.normal import NORMAL_LAWS
from sand_sim.contact.rolling import ROLLING_LAWS, TWISTING_LAWS
from sand_sim.contact.tangential import TANGENTIAL_LAWS
from sand_sim.precision import Precision

SLOTS = {
    "normal": NORMAL_LAWS,
    "tangential": TANGENTIAL_LAWS,
    "rolling": ROLLING_LAWS,
    "twisting": TWISTING_LAWS,
    "cohesion": COHESION_LAWS,
}


@dataclass(frozen=True)
class ContactModel:
    """One law per slot; static, so another choice is another kernel."""

    normal: str = "hertz"
    tangential: str = "mindlin"
    rolling: str = "none"
    twisting: str = "none"
    cohesion: str = "none"

    def law(self, slot: str) -> Law:
        """The chosen law of a slot."""
        return SLOTS[slot][getattr(self, slot)]

    @property  # not cached: a scene that has been used goes to other processes, and what builds kernels cannot
    def laws(self) -> dict[str, Law]:
        """Chosen laws by slot."""
        return {slot: self.law(slot) for slot in SLOTS}

    @property
    def memory(self) -> tuple[int, ...]:
        """Signs of all remembered numbers of a contact when its bodies swap roles, slot after slot."""
        return sum((law.memory for law in self.laws.values()), ())

    def offset(self, slot: str) -> int:
        """Where the memory of a slot begins."""
        before = list(SLOTS)[: list(SLOTS).index(slot)]
        return sum(len(self.laws[name].memory) for name in before)

    @property
    def history(self) -> bool:
        """Whether contacts remember anything."""
        return bool(self.memory)

    @property
    def springs(self) -> bool:
        """Whether contacts remember how they have slipped, rolled or twisted."""
        return any(self.laws[slot].memory for slot in ("tangential", "rolling", "twisting"))

    @property
    def rotation(self) -> bool:
        """Whether contacts can turn a sphere."""
        return any(law.rotation for law in self.laws.values())

    @property
    def couples(self) -> bool:
        """Whether contacts exert moments of their own, beside those of forces on lever arms."""
        return self.rolling != "none" or self.twisting != "none"

    @property
    def cohesive(self) -> bool:
        """Whether contacts act across gaps or pull."""
        return self.cohesion != "none"

    @property
    def bonds(self) -> bool:
        """Whether contacts act across gaps, for which they remember that they have touched."""
        return bool(self.law("cohesion").memory)

    @property
    def asks(self) -> tuple[str, ...]:
        """Numbers that the scene must give for each pair of materials."""
        return tuple(dict.fromkeys(ask for law in self.laws.values() for ask in law.asks))

    def types(self, precision: Precision) -> ContactTypes:
        """The structs that the chosen laws read."""
        fields = tuple(dict.fromkeys(name for law in self.laws.values() for name in law.fields))
        return ContactTypes(contact_type(precision), pair_type(precision, fields))
