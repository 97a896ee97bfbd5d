/* A gantry behind libmodbus: an independent peer for the Modbus driver's tests.
 *
 *   gantry tcp              prints "ready PORT", serves one connection after another
 *   gantry rtu DEVICE BAUD  prints "ready 0", serves unit 1 without parity
 *
 * Outputs at 0x100: two volts, the enables, a sequence number. Inputs at 0: two counts of 32 bit,
 * high word first, and the sequence number's echo. With each request of function code 23 the count
 * of every enabled axis moves by its output word.
 */
#include <modbus.h>
#include <arpa/inet.h>
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { OUTPUTS = 0x100, REGISTERS = 0x200 };

static modbus_mapping_t *map;
static int32_t counts[2];

static unsigned word(const uint8_t *at) { return (unsigned)at[0] << 8 | at[1]; }

static void show(unsigned sequence)
{
    for (int i = 0; i < 2; i++) {
        map->tab_registers[2 * i] = (uint16_t)((uint32_t)counts[i] >> 16);
        map->tab_registers[2 * i + 1] = (uint16_t)counts[i];
    }
    map->tab_registers[4] = (uint16_t)sequence;
}

static void move(const uint8_t *pdu)
{
    const uint8_t *data = pdu + 10;
    if (pdu[0] != MODBUS_FC_WRITE_AND_READ_REGISTERS || word(pdu + 5) != OUTPUTS || pdu[9] < 8)
        return;
    for (int i = 0; i < 2; i++)
        if (word(data + 4) >> i & 1)
            counts[i] += (int16_t)word(data + 2 * i);
    show(word(data + 6));
}

static int serve(modbus_t *ctx)
{
    uint8_t query[MODBUS_MAX_ADU_LENGTH];
    int header = modbus_get_header_length(ctx);
    for (;;) {
        int size = modbus_receive(ctx, query);
        if (size < 0 && (errno == EMBBADCRC || errno == ETIMEDOUT))
            continue;
        if (size < 0)
            return -1;
        if (size == 0)
            continue; /* for another unit */
        move(query + header);
        if (modbus_reply(ctx, query, size, map) < 0)
            return -1;
    }
}

int main(int argc, char **argv)
{
    map = modbus_mapping_new(0, 0, REGISTERS, 0);
    if (map == NULL || argc < 2)
        return 2;
    if (strcmp(argv[1], "rtu") == 0 && argc == 4) {
        modbus_t *ctx = modbus_new_rtu(argv[2], atoi(argv[3]), 'N', 8, 2);
        if (ctx == NULL || modbus_set_slave(ctx, 1) < 0 || modbus_connect(ctx) < 0) {
            fprintf(stderr, "%s\n", modbus_strerror(errno));
            return 1;
        }
        puts("ready 0");
        fflush(stdout);
        return serve(ctx) < 0;
    }
    modbus_t *ctx = modbus_new_tcp("127.0.0.1", 0);
    int listener = ctx == NULL ? -1 : modbus_tcp_listen(ctx, 1);
    struct sockaddr_in name;
    socklen_t length = sizeof name;
    if (listener < 0 || getsockname(listener, (struct sockaddr *)&name, &length) < 0) {
        fprintf(stderr, "%s\n", modbus_strerror(errno));
        return 1;
    }
    printf("ready %d\n", ntohs(name.sin_port));
    fflush(stdout);
    while (modbus_tcp_accept(ctx, &listener) >= 0) {
        serve(ctx);
        modbus_close(ctx);
    }
    return 1;
}
