/* The link between a host and the cell; link.h describes the frames. */
#include "link.h"

#include "cell.h"

#define MAX(a, b) ((a) > (b) ? (a) : (b))

static const uint8_t hash[] = HASH; /* of architecture and weights */
static const char label[] = LABEL;  /* name of controller and voxel, for messages to people */
static const uint8_t sizes[] = {1, ARITHMETIC, N_SENSORS, N_C, N_DESTINATIONS}; /* version 1 */

enum {
    HEAD = 7,  /* bytes of kind, session and step */
    CHECK = 2, /* bytes of the CRC */
    HELLO_SIZE = 1 + 2 + 4 + (int)(sizeof sizes + sizeof hash + sizeof label - 1),
    STEP_SIZE = HEAD + (int)(N_SENSORS * sizeof(reading) + N_RECEIVED * sizeof(word)),
    ANSWER_SIZE = HEAD + (int)(sizeof(actuation) + N_SENT * sizeof(word) + sizeof(uint32_t)),
    LARGEST = MAX(HELLO_SIZE, MAX(STEP_SIZE, ANSWER_SIZE)) + CHECK,
    FRAME = LARGEST + LARGEST / 254 + 2, /* with the bytes that COBS adds */
};

static uint8_t received[FRAME], sent[FRAME], answer[ANSWER_SIZE + CHECK];
static unsigned n_received;
static uint16_t session;   /* 0 after a start */
static uint32_t last_step; /* of the session; `answer` is its answer, or begins with 0 */

/* CRC-16/CCITT: polynomial 0x1021, initial value 0xffff. */
static uint16_t crc(const uint8_t *bytes, unsigned n)
{
    unsigned sum = 0xffff;
    for (; n > 0; n--) {
        unsigned x = (sum >> 8) ^ *bytes++;
        x ^= x >> 4;
        sum = ((sum << 8) ^ (x << 12) ^ (x << 5) ^ x) & 0xffff;
    }
    return (uint16_t)sum;
}

/* Copy n bytes of a number and return the place behind them. */
static uint8_t *copy(void *place, const void *from, unsigned n)
{
    uint8_t *to = place;
    for (const uint8_t *byte = from; n > 0; n--)
        *to++ = *byte++;
    return to;
}

/* Send a payload, behind which there is space for the CRC. COBS: a block is its length + 1 and up
 * to 254 bytes that are not 0; it stands for these and, if they are fewer than 254, a 0. */
static void send_frame(uint8_t *payload, unsigned n)
{
    unsigned start = 0, end = 1;
    uint16_t check = crc(payload, n);
    copy(payload + n, &check, CHECK);
    for (unsigned i = 0; i < n + CHECK; i++) {
        if (payload[i] != 0)
            sent[end++] = payload[i];
        if (payload[i] == 0 || end - start == 255) {
            sent[start] = (uint8_t)(end - start);
            start = end++;
        }
    }
    sent[start] = (uint8_t)(end - start);
    sent[end++] = 0;
    board_send(sent, end);
}

/* Undo COBS in place and check the CRC; return the size of the payload, 0 if it is damaged. */
static unsigned unpack(uint8_t *frame, unsigned n)
{
    unsigned from = 0, to = 0;
    uint16_t check;
    while (from < n) {
        unsigned block = frame[from++];
        if (from + block - 1 > n)
            return 0;
        for (unsigned i = 1; i < block; i++)
            frame[to++] = frame[from++];
        if (block < 255 && from < n)
            frame[to++] = 0;
    }
    if (to <= CHECK)
        return 0;
    copy(&check, frame + to - CHECK, CHECK);
    return check == crc(frame, to - CHECK) ? to - CHECK : 0;
}

static void answer_session(uint8_t kind)
{
    received[0] = kind; /* the request has been read */
    copy(received + 1, &session, sizeof session);
    send_frame(received, 1 + sizeof session);
}

static void say_hello(void)
{
    uint8_t *end = copy(received + 1, sizes, sizeof sizes);
    received[0] = 'h';
    end = copy(end, hash, sizeof hash);
    end = copy(end, &session, sizeof session);
    end = copy(end, &board_tick_rate, sizeof board_tick_rate);
    copy(end, label, sizeof label - 1);
    send_frame(received, HELLO_SIZE);
}

/* Make control step k and keep the answer, unless a reading is out of range. */
static void step(uint32_t k, const uint8_t *request)
{
    static struct inputs in; /* static, so that the stack is small whatever the sizes */
    static struct outputs out;
    copy(in.readings, request + HEAD, sizeof in.readings);
    copy(in.received, request + HEAD + sizeof in.readings, sizeof in.received);
    for (unsigned s = 0; s < N_SENSORS; s++)
        if (!IS_READING(in.readings[s]))
            return;
    uint32_t start = board_ticks();
    cell_step(k, &in, &out);
    uint32_t ticks = board_ticks() - start;
    last_step = k;
    uint8_t *end = copy(answer, request, HEAD);
    answer[0] = 's';
    end = copy(end, &out.actuation, sizeof out.actuation);
    end = copy(end, out.sent, sizeof out.sent);
    copy(end, &ticks, sizeof ticks);
    send_frame(answer, ANSWER_SIZE);
}

static void execute(const uint8_t *request, unsigned n)
{
    uint16_t asked;
    uint32_t k;
    copy(&asked, request + 1, sizeof asked);
    copy(&k, request + 3, sizeof k);
    if (request[0] == 'H' && n == 1) {
        say_hello();
    } else if (request[0] == 'R' && n == 3) {
        if (asked != session) {
            cell_reset();
            session = asked;
            answer[0] = 0;
        }
        answer_session('r');
    } else if (request[0] == 'S' && n == STEP_SIZE) {
        if (asked != session || session == 0)
            answer_session('n');
        else if (answer[0] && k == last_step)
            send_frame(answer, ANSWER_SIZE);
        else if (!answer[0] || k > last_step)
            step(k, request);
    }
}

void link_receive(uint8_t byte)
{
    if (byte != 0) {
        if (n_received < FRAME)
            received[n_received++] = byte; /* a frame that fills the buffer is too long */
        return;
    }
    unsigned n = n_received < FRAME ? unpack(received, n_received) : 0;
    n_received = 0;
    if (n > 0)
        execute(received, n);
}
