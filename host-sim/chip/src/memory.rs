//! Flash and SRAM: memory that the processor and the DMA share.

use std::ffi::c_void;

/// A page of the host, at least.
const PAGE: usize = 4096;

#[repr(C, align(4096))]
#[derive(Clone)]
struct Page([u8; PAGE]);

/// Memory allocated until the program ends. Copies refer to the same bytes; used by one thread only.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Memory {
    base: u32,
    bytes: u32,
    first: *mut u8,
}

impl Memory {
    /// `bytes` bytes, a multiple of a page, at this address of the chip.
    pub(crate) fn new(base: u32, bytes: u32, fill: u8) -> Self {
        let pages = vec![Page([fill; PAGE]); (bytes as usize).div_ceil(PAGE)];
        let first = Box::leak(pages.into_boxed_slice()).as_mut_ptr().cast();
        Self { base, bytes, first }
    }

    pub(crate) const fn base(self) -> u32 {
        self.base
    }

    pub(crate) const fn bytes(self) -> usize {
        self.bytes as usize
    }

    pub(crate) const fn pointer(self) -> *mut c_void {
        self.first.cast()
    }

    /// Pointer to these bytes, if all are within this memory.
    fn place(self, address: u32, bytes: u32) -> Option<usize> {
        let offset = address.checked_sub(self.base)?;
        (offset.checked_add(bytes)? <= self.bytes).then_some(offset as usize)
    }

    /// The word at this address, which is a multiple of four.
    #[allow(unsafe_code, reason = "memory that the processor shares")]
    pub(crate) fn word(self, address: u32) -> Option<u32> {
        let offset = self.place(address & !3, 4)?;
        // SAFETY: within the memory, which is aligned to a page; the processor of the library does not run meanwhile, or waits in a hook.
        Some(unsafe { self.first.add(offset).cast::<u32>().read_volatile() })
    }

    /// The halfword at this address.
    pub(crate) fn half(self, address: u32) -> Option<u16> {
        Some((self.word(address)? >> (8 * (address & 2))) as u16)
    }

    /// Sets the word at this address; false outside.
    #[allow(unsafe_code, reason = "memory that the processor shares")]
    pub(crate) fn set_word(self, address: u32, value: u32) -> bool {
        let Some(offset) = self.place(address & !3, 4) else {
            return false;
        };
        // SAFETY: as in `word`.
        unsafe { self.first.add(offset).cast::<u32>().write_volatile(value) };
        true
    }

    /// How many of these words, from an address that is a multiple of four on, have this value, up to the first other one; None where they are not all within
    /// this memory.
    #[allow(unsafe_code, reason = "memory that the processor shares")]
    pub(crate) fn repeats(self, address: u32, words: u32, value: u32) -> Option<u32> {
        let offset = self.place(address & !3, words.checked_mul(4)?)?;
        // SAFETY: within the memory, which is aligned to a page; nothing writes to it meanwhile, as in `word`.
        let words =
            unsafe { std::slice::from_raw_parts(self.first.add(offset).cast::<u32>(), words as usize) };
        let other = words.iter().position(|word| *word != value);
        Some(other.unwrap_or(words.len()) as u32)
    }

    /// Sets these words; false where they are not all within this memory.
    #[allow(unsafe_code, reason = "memory that the processor shares")]
    pub(crate) fn fill_words(self, address: u32, words: u32, value: u32) -> bool {
        let Some(offset) = words
            .checked_mul(4)
            .and_then(|bytes| self.place(address & !3, bytes))
        else {
            return false;
        };
        // SAFETY: as in `repeats`; the slice is the only reference while it exists.
        unsafe { std::slice::from_raw_parts_mut(self.first.add(offset).cast::<u32>(), words as usize) }
            .fill(value);
        true
    }

    /// Sets every byte.
    #[allow(unsafe_code, reason = "memory that the processor shares")]
    pub(crate) fn fill(self, value: u8) {
        // SAFETY: within the memory, to which no reference exists; the processor of the library does not run meanwhile.
        unsafe { std::ptr::write_bytes(self.first, value, self.bytes as usize) };
    }

    /// Copies bytes there; false where they do not fit.
    #[allow(unsafe_code, reason = "memory that the processor shares")]
    pub(crate) fn load(self, address: u32, data: &[u8]) -> bool {
        let Some(offset) = u32::try_from(data.len())
            .ok()
            .and_then(|bytes| self.place(address, bytes))
        else {
            return false;
        };
        // SAFETY: within the memory, to which no reference exists.
        unsafe { std::ptr::copy_nonoverlapping(data.as_ptr(), self.first.add(offset), data.len()) };
        true
    }
}
