/* Modes of many contacts, as numbers.
 *
 * With m contacts there are 3^m modes. A contact's guards and constants depend on its own entry alone: -1 or +1 in
 * slip, 0 while it slides (henon_ref/modes/decoupled_contacts.py and coupled_contacts.py have one set of equations for
 * all modes; so do systems with further surfaces that are crossed, which have no entry 0). A run therefore keeps the
 * entries, two bits each, and one record and one row of constants, those of its present mode. An event changes the
 * parts of its contact, and a new mode costs nothing.
 *
 * Contact i has the guards 2 i and 2 i + 1: in slip its surface and no guard, in sliding the two ends of the slide.
 */

/* Position of a contact's entry in its word, in bits. */
static inline int64_t bit_of(int64_t contact)
{
    return 2 * (contact % ENTRIES_IN_WORD);
}

/* Entry of a contact in words of entries: -1, 0 or +1. */
static inline int64_t entry_in(const int64_t *words, int64_t contact)
{
    return (int64_t)((uint64_t)words[contact / ENTRIES_IN_WORD] >> bit_of(contact) & 3) - 1;
}

/* Copy a contact's guards and constants from the row of its entry. */
static void take_part(struct work *w, int64_t contact, int64_t row)
{
    const struct tables *tables = w->tables;
    const struct guard *guard = mode_at(w, row)->guard;
    const double *numbers = constants_of(tables, row, 0);
    w->own->guard[2 * contact] = guard[2 * contact], w->own->guard[2 * contact + 1] = guard[2 * contact + 1];
    int64_t end = tables->owned_ends[contact];
    for (int64_t k = contact ? tables->owned_ends[contact - 1] : 0; k < end; k++)
        w->own_constants[tables->owned[k]] = numbers[tables->owned[k]];
}

/* Assemble the record and the constants of the present mode from the three rows that represent all modes. */
static void put_together(struct work *w)
{
    if (!w->words)
        return;
    memcpy(w->own, mode_at(w, 0), (size_t)mode_size(w->run->guards) * sizeof(double));
    memcpy(w->own_constants, w->tables->numbers, (size_t)w->run->constants * sizeof(double));
    for (int64_t i = 0; i < w->run->contacts; i++)
        take_part(w, i, entry_in(w->entries, i) + 1);
}

/* Enter the mode in a row; with contacts, the mode in which one contact has the entry of that row. Returns the row that
 * leads back. */
static inline int64_t go_over(struct work *w, int64_t contact, int64_t row)
{
    struct run *run = w->run;
    int64_t before = run->mode;
    if (w->words) {
        uint64_t *word = (uint64_t *)w->entries + contact / ENTRIES_IN_WORD;
        before = entry_in(w->entries, contact) + 1;
        *word = (*word & ~((uint64_t)3 << bit_of(contact))) | (uint64_t)row << bit_of(contact);
        take_part(w, contact, row);
        run->stepped_mode = -1; /* enter_mode looks up the mode */
    } else {
        run->mode = row;
        enter(w);
    }
    return before;
}

/* Store the mode that an event ends. */
static inline void leave(struct work *w)
{
    memcpy(w->left, w->entries, (size_t)w->words * sizeof(int64_t));
}
