//! The contact of a probe or a home switch: where it first closed, and whether it stays closed.

/// Ticks after the first contact within which a contact may bounce.
const BOUNCE_TICKS: u32 = 15;

/// Where the axis was when its contact closed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Contact {
    /// The position at the first raw contact, nm.
    pub(super) touched_nm: Option<i32>,
    /// Ticks since the first contact.
    ticks: u32,
    /// The last of these ticks in which the contact was open.
    open_at: u32,
}

impl Contact {
    pub(super) const NONE: Self = Self {
        touched_nm: None,
        ticks: 0,
        open_at: 0,
    };

    /// Another tick; `at_nm`: where the axis is.
    pub(super) fn look(&mut self, is_closed: bool, at_nm: i32) {
        if self.touched_nm.is_some() {
            self.ticks = self.ticks.saturating_add(1);
            if !is_closed {
                self.open_at = self.ticks;
            }
        } else if is_closed {
            self.touched_nm = Some(at_nm);
        }
    }

    pub(super) const fn bounces(&self) -> bool {
        self.open_at > BOUNCE_TICKS
    }
}
