/* Reader of the part of JSON that occurs in requests by henon_ref. */
#ifndef HENON_REF_JSON_H
#define HENON_REF_JSON_H

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

static const char *json_blank(const char *at)
{
    while (isspace((unsigned char)*at)) at++;
    return at;
}

/* Position after the text that begins at a quotation mark. */
static const char *json_after_text(const char *at)
{
    for (at++; *at && *at != '"'; at++)
        if (*at == '\\' && at[1]) at++;
    return *at ? at + 1 : at;
}

/* Position after a value of any kind. */
static const char *json_after(const char *at)
{
    int depth = 0;
    at = json_blank(at);
    do {
        if (*at == '"') {
            at = json_after_text(at);
            continue;
        }
        depth += (*at == '{' || *at == '[') - (*at == '}' || *at == ']');
        at++;
        if (!depth && (*at == ',' || *at == '}' || *at == ']')) break;
    } while (*at && (depth || !strchr(",}]", *at)));
    return at;
}

/* Value of a member of the object at this position; NULL if the object has no such member. */
static const char *json_member(const char *at, const char *name)
{
    size_t length = strlen(name);
    if (!at) return NULL;
    at = json_blank(at);
    if (*at != '{') return NULL;
    for (at = json_blank(at + 1); *at == '"'; at = json_blank(at + 1)) {
        const char *key = at + 1, *value = json_after_text(at);
        int same = (size_t)(value - key) == length + 1 && !strncmp(key, name, length);
        value = json_blank(value);
        if (*value == ':') value = json_blank(value + 1);
        if (same) return value;
        at = json_blank(json_after(value));
        if (*at != ',') return NULL;
    }
    return NULL;
}

static double json_number(const char *at)
{
    return at ? strtod(at, NULL) : 0.0;
}

/* Read the numbers of an array, or of an object's members, in their order; return their number. */
static int json_numbers(const char *at, double *out, int most)
{
    int count = 0;
    if (!at) return 0;
    at = json_blank(at);
    if (*at != '[' && *at != '{') return 0;
    for (at = json_blank(at + 1); *at && *at != ']' && *at != '}' && count < most; at = json_blank(at)) {
        if (*at == '"') {
            at = json_blank(json_after_text(at));
            if (*at == ':') at++;
        }
        out[count++] = strtod(at, NULL);
        at = json_blank(json_after(at));
        if (*at == ',') at++;
    }
    return count;
}

#endif
